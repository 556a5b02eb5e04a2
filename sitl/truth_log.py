"""Truth log: an MCAP file of the true vehicle state, written on request only."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from mavlink_io.clock import Interval
from mavlink_io.user_data_dir import open_output
from sitl.core.truth import Truth

TOPIC = "/auv/truth"
CHUNK_BYTES = 64_000
FLUSH_PERIOD_S = 0.25
"""Wall time between flushes: a killed process loses at most this much."""

_VECTORS = {
    "position_ned_m": 3,
    "attitude_q": 4,
    "velocity_ned_mps": 3,
    "rates_radps": 3,
    "specific_force_mps2": 3,
    "water_velocity_ned_mps": 3,
}
_SCALARS = (
    "rudder_rad",
    "elevator_rad",
    "propeller_rps",
    "pitch_disturbance_nm",
    "yaw_disturbance_nm",
    "surface_m",
    "wave_pressure_pa",
)
_SCHEMA = {
    "title": "auv.Truth",
    "description": (
        "The simulated vehicle, FRD in NED, SI units; rudder and elevator are true duct angles."
    ),
    "type": "object",
    "properties": {
        "time_us": {"type": "integer", "description": "vehicle time"},
        **{
            name: {"type": "array", "items": {"type": "number"}, "minItems": size, "maxItems": size}
            for name, size in _VECTORS.items()
        },
        **{name: {"type": "number"} for name in _SCALARS},
        "flooding": {"type": "boolean"},
        "faults": {"type": "array", "items": {"type": "string"}},
    },
}


class TruthLog:
    """Truth log with one JSON channel.

    Log time is the UNIX time of the start of a run plus vehicle time. It never decreases.
    """

    def __init__(self, path: Path) -> None:
        """Create the file.

        Raises OSError, also when it exists: a log is never overwritten.
        """
        self._file = open_output(path, "xb")
        self._launch_ns = self._newest_ns = time.time_ns()
        self._flush = Interval(FLUSH_PERIOD_S)
        self._writer: Any = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.start()
        schema = self._writer.register_schema(
            "auv.Truth", "jsonschema", json.dumps(_SCHEMA).encode()
        )
        self._channel = self._writer.register_channel(TOPIC, "json", schema)

    def write(self, truth: Truth) -> None:
        """Append the state of one tick."""
        if truth.time_us == 0:
            self._launch_ns = max(self._newest_ns, time.time_ns())
        self._newest_ns = log_ns = self._launch_ns + truth.time_us * 1000
        message = json.dumps(truth._asdict()).encode()
        self._writer.add_message(self._channel, log_ns, message, log_ns)
        if self._flush.due():
            self._writer.flush()

    def close(self) -> None:
        """Write the index and close the file."""
        self._writer.finish()
        self._file.close()
