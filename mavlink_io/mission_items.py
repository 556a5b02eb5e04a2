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


class MissionCommand(IntEnum):
    """MAV_CMD of the items that this vehicle flies."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN = 20
    LAND = 21
    DELAY = 93
    CHANGE_ALTITUDE_WAIT = 113
    YAW = 115
    JUMP = 177
    CHANGE_SPEED = 178
    CHANGE_ALTITUDE = 186
    TEST = 31010
    """MAV_CMD_USER_1."""
