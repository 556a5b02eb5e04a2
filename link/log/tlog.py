"""A MAVLink telemetry log (.tlog): each frame as it came, after the UNIX time in microseconds as 8 bytes, big-endian.

QGroundControl, Mission Planner, MAVProxy and pymavlink's tools read it; the format is theirs (MAVProxy's ``mav.tlog``).
"""

import struct
from pathlib import Path

_STAMP = struct.Struct(">Q")


class TelemetryLog:
    """An open tlog. A reader that replays it waits from stamp to stamp, so no stamp is before the last one."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._time_us = 0

    def write(self, time_us: int, raw: bytes) -> None:
        """Add a frame; ``time_us`` is UNIX time."""
        self._time_us = max(self._time_us, time_us)
        self._file.write(_STAMP.pack(self._time_us) + raw)

    def flush(self) -> None:
        """Hand what was written to the operating system now."""
        self._file.flush()

    def close(self) -> None:
        self._file.close()
