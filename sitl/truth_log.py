"""The truth log: an MCAP file of what really happened, written only when asked for."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from mavlink_io.clock import Every
from sitl.core.truth import Truth

TOPIC = "/auv/truth"
CHUNK_BYTES = 64_000
FLUSH_PERIOD_S = 0.25
"""Wall time: a killed process loses at most this much."""

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
    """One channel of JSON; log time is the UNIX time of the launch plus vehicle time, and never
    goes back."""

    def __init__(self, path: Path) -> None:
        """Create the file. Raises OSError, also when it exists: a log is never written over."""
        self._file = path.open("xb")
        self._launch_ns = self._newest_ns = time.time_ns()
        self._flush = Every(FLUSH_PERIOD_S)
        self._writer: Any = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.start()
        schema = self._writer.register_schema(
            "auv.Truth", "jsonschema", json.dumps(_SCHEMA).encode()
        )
        self._channel = self._writer.register_channel(TOPIC, "json", schema)

    def write(self, truth: Truth) -> None:
        if truth.time_us == 0:
            self._launch_ns = max(self._newest_ns, time.time_ns())
        self._newest_ns = at_ns = self._launch_ns + truth.time_us * 1000
        self._writer.add_message(self._channel, at_ns, json.dumps(truth._asdict()).encode(), at_ns)
        if self._flush.due():
            self._writer.flush()

    def close(self) -> None:
        self._writer.finish()
        self._file.close()
