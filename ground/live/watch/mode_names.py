"""Find the name of a flight mode: from the vehicle's own list, else from published tables."""

from collections.abc import Mapping
from typing import Any

from ground.client import mode_map
from mavlink_io.dialect import constant, enum_names
from mavlink_io.errors import InputError

CUSTOM_MODE_FLAG = constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED")
_PX4, _ARDUPILOT = constant("MAV_AUTOPILOT_PX4"), constant("MAV_AUTOPILOT_ARDUPILOTMEGA")

_PX4_MAIN = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
}
_PX4_AUTO = {
    1: "READY",
    2: "TAKEOFF",
    3: "HOLD",
    4: "MISSION",
    5: "RETURN",
    6: "LAND",
    8: "FOLLOW",
    9: "PRECLAND",
}
_PX4_AUTO_MAIN = 4
"""Main mode AUTO of PX4. custom_mode has the main mode in bits 16 to 23 and the sub mode of AUTO in
bits 24 to 31 (PX4, px4_custom_mode.h)."""

_ARDUPILOT_TABLES = {
    "SUB_MODE": ("SUBMARINE",),
    "PLANE_MODE": ("FIXED_WING",),
    "COPTER_MODE": (
        "QUADROTOR",
        "HEXAROTOR",
        "OCTOROTOR",
        "TRICOPTER",
        "COAXIAL",
        "HELICOPTER",
        "DODECAROTOR",
    ),
    "ROVER_MODE": ("GROUND_ROVER", "SURFACE_BOAT"),
    "TRACKER_MODE": ("ANTENNA_TRACKER",),
}
_TABLE_BY_TYPE = {
    constant(f"MAV_TYPE_{kind}"): table
    for table, kinds in _ARDUPILOT_TABLES.items()
    for kind in kinds
}


def name(heartbeat: Any, offered: Mapping[int, str]) -> str:
    """Return the mode name of a HEARTBEAT; ``offered``: the vehicle's own names by custom_mode."""
    number = heartbeat.custom_mode
    if not heartbeat.base_mode & CUSTOM_MODE_FLAG:
        return f"base mode {heartbeat.base_mode:#04x}"
    return (
        offered.get(number)
        or _installed(heartbeat.type).get(str(number))
        or _published(heartbeat.autopilot, heartbeat.type, number)
        or f"mode {number}"
    )


def known(heartbeat: Any) -> dict[str, int]:
    """Return custom_mode by name for a vehicle that does not list its modes.

    The names are from published tables and from the user's ``custom_mode_map.json``.
    """
    table = _TABLE_BY_TYPE.get(heartbeat.type) if heartbeat.autopilot == _ARDUPILOT else None
    published = enum_names(table) if table else {}
    modes = {entry.removeprefix(f"{table}_"): number for number, entry in published.items()}
    return modes | {entry: int(number) for number, entry in _installed(heartbeat.type).items()}


def _installed(kind: int) -> Mapping[str, str]:
    """Return the names of the user's ``custom_mode_map.json``; none if it cannot be read."""
    try:
        return mode_map.read(mode_map.DEFAULT_PATH.expanduser()).get(str(kind), {})
    except InputError:
        return {}


def _published(autopilot: int, kind: int, number: int) -> str | None:
    """Return the name of a mode number in the tables of PX4 or ArduPilot; None if unknown."""
    if autopilot == _PX4:
        main, sub = number >> 16 & 0xFF, number >> 24
        return _PX4_AUTO.get(sub) if main == _PX4_AUTO_MAIN else _PX4_MAIN.get(main)
    if autopilot == _ARDUPILOT and kind in _TABLE_BY_TYPE:
        table = _TABLE_BY_TYPE[kind]
        return enum_names(table).get(number, "").removeprefix(f"{table}_") or None
    return None
