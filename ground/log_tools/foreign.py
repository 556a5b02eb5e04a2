"""Inspect logs in other formats: MAVLink .tlog, ArduPilot .bin and PX4 .ulg."""

from pathlib import Path
from typing import Any

import numpy as np

from ground.log_tools.mcap import MAX_GAP_S
from sysid.data import readers
from sysid.data.readers.samples import MessageColumns, clock_steps


def is_foreign(path: Path) -> bool:
    """Return whether a file is a log in another format.

    Raises
    ------
    InputError
        The file cannot be read, or its format is unknown.
    """
    return readers.format_of(path) != "mcap"


def info(path: Path) -> dict[str, Any]:
    """Return duration and messages by name, with the keys of `mcap.info`.

    ``lost_frames`` is None because these logs contain no sequence numbers.

    Raises
    ------
    InputError
        The log cannot be read.
    """
    tables, damage = readers.load(path)
    regular, most_frequent = max(tables.items(), key=lambda item: item[1].time_s.size)
    restarts = [
        f"the time of {regular} went back by {step.back_s:.1f} s at {step.time_s:.1f} s: a restart"
        " of the autopilot, or several logs in one"
        for step in clock_steps(regular, most_frequent.time_s)
    ]
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
        "damage": [*([damage] if damage else []), *restarts],
        "gaps": _gaps(most_frequent),
    }


def _gaps(regular: MessageColumns) -> list[dict[str, float]]:
    """Return begin and length of the times without the most frequent message."""
    intervals_s = np.diff(regular.time_s)
    return [
        {"start_s": float(regular.time_s[index]), "length_s": float(intervals_s[index])}
        for index in np.flatnonzero(intervals_s > MAX_GAP_S)
    ]
