"""What identification can take from public logs, or why nothing."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mavlink_io.errors import InputError
from sysid.data import readers
from sysid.data.dataset import Array, Log
from sysid.screening import proposals

SUFFIXES = (".bin", ".tlog", ".ulg")
MIN_COMMAND_HZ = 5.0
"""Rate of commands below which the screening rejects every test (a gap of 0.2 s)."""
MIN_MOVE_DEG = 1.0
"""Range of a surface's command that counts as motion."""
MOTORS = range(33, 41)
"""Values of SERVOn_FUNCTION for the motors of ArduSub and ArduCopter."""


class LogFinding(NamedTuple):
    """Result of one log."""

    name: str
    segments: int
    """Number of segments that can be used as tests."""
    velocity: str
    """Source of the velocity."""
    result: str
    """What can be identified, or the reasons why nothing can."""


def examine(folder: Path) -> list[LogFinding]:
    """Return the findings of all logs below a folder.

    Parameters
    ----------
    folder : Path
        Checkout.

    Returns
    -------
    list of LogFinding
        One per log, in the order of the names.
    """
    logs = (path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES)
    return [_examine(path, str(path.relative_to(folder))) for path in sorted(logs)]


def _examine(path: Path, name: str) -> LogFinding:
    """Return the finding of one log."""
    try:
        log = readers.read(path)
    except InputError as error:
        return LogFinding(name, 0, "", str(error).removeprefix(f"{path}: "))
    segments = proposals.propose(log)
    reasons = _reasons(log)
    found = f"{len(segments)} usable segments" if segments else "nothing: " + "; ".join(reasons)
    return LogFinding(name, len(segments), log.velocity.source, found)


def _reasons(log: Log) -> list[str]:
    """Return why no segment of a log can be used."""
    reasons = []
    motors = sum(log.parameters.get(f"SERVO{n}_FUNCTION", 0.0) in MOTORS for n in range(1, 9))
    if motors:
        reasons.append(f"{motors} outputs are motors of a thruster frame, no rudder or elevator")
    elif log.parameters.get("MAV_TYPE") == 2.0:
        reasons.append("a quadrotor, no rudder or elevator")
    rate_hz = 1.0 / float(np.median(np.diff(log.actuators.time_s)))
    if rate_hz < MIN_COMMAND_HZ:
        reasons.append(f"commands at {rate_hz:.1f} Hz, at least {MIN_COMMAND_HZ:g} needed")
    moves = (_range_deg(log.actuators.rudder_rad), _range_deg(log.actuators.elevator_rad))
    if max(moves) < MIN_MOVE_DEG:
        reasons.append(f"outputs 1 and 2 move by {max(moves):.1f} deg")
    return reasons or ["no large change of a surface from steady motion"]


def _range_deg(angle_rad: Array) -> float:
    """Return the range of an angle (deg)."""
    return math.degrees(float(np.ptp(angle_rad)))
