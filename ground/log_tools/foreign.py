"""Inspect logs in other formats: MAVLink .tlog, ArduPilot .bin and PX4 .ulg."""

from pathlib import Path
from typing import Any

from sysid.data import readers
from sysid.data.dataset import LogError


def is_foreign(path: Path) -> bool:
    """Return whether a file is a log in another format; unknown files count as MCAP."""
    try:
        return readers.format_of(path) != "mcap"
    except LogError:
        return False


def info(path: Path) -> dict[str, Any]:
    """Return duration and messages by name, with the keys of `mcap.info`.

    ``lost_frames`` is None because these logs contain no sequence numbers.

    Raises
    ------
    InputError
        The log cannot be read.
    """
    tables, damage = readers.load(path)
    first_s = min(float(table.time_s.min()) for table in tables.values())
    last_s = max(float(table.time_s.max()) for table in tables.values())
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "first_s": first_s,
        "vehicle_s": last_s - first_s,
        "messages": sum(table.time_s.size for table in tables.values()),
        "lost_frames": None,
        "topics": {name: table.time_s.size for name, table in sorted(tables.items())},
        "attachments": [],
        "metadata": {},
        "damage": [damage] if damage else [],
    }
