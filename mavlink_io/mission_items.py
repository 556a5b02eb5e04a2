"""Mission items: the record that the mission protocol carries, its frames, and the commands used.

This module imports no MAVLink dialect, so the pure tick can use it.
"""

from enum import IntEnum
from typing import NamedTuple

MISSION_TYPE, ALL_TYPES = 0, 255
"""MAV_MISSION_TYPE: the only kind of plan that is kept here, and the one that means every kind."""

FRAME_LOCAL_NED, FRAME_MISSION = 1, 2

GLOBAL_FRAMES = frozenset((0, 3, 5, 6))
"""Global frames, with and without _INT, absolute and relative: alike to a vehicle whose home is the
surface."""

LOCAL_SCALE, GLOBAL_SCALE = 10**4, 10**7
"""What an item counts for a metre in a local frame and for a degree in a global one."""

NOT_GIVEN = (1 << 31) - 1
"""In place of a latitude or longitude, of an item or of a COMMAND_INT."""


class MissionItem(NamedTuple):
    """One item as MISSION_ITEM_INT carries it. Parameters may be NaN: not given."""

    sequence: int
    frame: int
    command: int
    current: int = 0
    autocontinue: int = 1
    p1: float = 0.0
    p2: float = 0.0
    p3: float = 0.0
    p4: float = 0.0
    x: int = 0
    """Latitude in 1e-7 degrees, 1e-4 m in local frames, the plain number in commands without a
    location."""
    y: int = 0
    z: float = 0.0
    """Altitude (minus the depth) in metres in global frames, depth in local ones."""
    mission_type: int = MISSION_TYPE


class MavCmd(IntEnum):
    """The MAV_CMD numbers that the programs use; each name is the dialect's without MAV_CMD_.

    Source: https://mavlink.io/en/messages/common.html#mav_commands.
    """

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_DELAY = 93
    CONDITION_CHANGE_ALT = 113
    """Continue with the next item when the depth is reached."""
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_CHANGE_ALTITUDE = 186
    DO_SET_ACTUATOR = 187
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_AUTOTUNE_ENABLE = 212
    DO_SET_MISSION_CURRENT = 224
    PREFLIGHT_CALIBRATION = 241
    PREFLIGHT_STORAGE = 245
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    DO_SET_STANDARD_MODE = 262
    MISSION_START = 300
    ACTUATOR_TEST = 310
    COMPONENT_ARM_DISARM = 400
    GET_HOME_POSITION = 410
    INJECT_FAILURE = 420
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    USER_1 = 31010
    """An excitation for system identification."""


def place_fault(item: MissionItem) -> tuple[int, str]:
    """Return what is wrong with the latitude and longitude of an item that has a place.

    Returns
    -------
    parameter : int
        5 for x, 6 for y, as MAV_MISSION_RESULT counts; 0 where nothing is wrong.
    reason : str
        With value and limits, "" where nothing is wrong.
    """
    if item.frame not in GLOBAL_FRAMES or (item.x == item.y == NOT_GIVEN):
        return 0, ""
    for parameter, value in ((5, item.x), (6, item.y)):
        if value == NOT_GIVEN:
            return parameter, "latitude and longitude: give both or none"
    for parameter, name, value, limit_deg in (
        (5, "latitude", item.x, 90),
        (6, "longitude", item.y, 180),
    ):
        if abs(value) > limit_deg * GLOBAL_SCALE:
            degrees = f"{value / GLOBAL_SCALE:.10g}"
            return parameter, f"{name} {degrees}: must be -{limit_deg} to {limit_deg} deg"
    return 0, ""
