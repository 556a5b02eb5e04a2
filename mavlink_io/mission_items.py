"""Mission items: their record, coordinate frames, and the MAV_CMD numbers in use.

This module does not import the MAVLink dialect, so that the pure tick can use it.
"""

from enum import IntEnum
from typing import NamedTuple

MISSION_TYPE, FENCE_TYPE, RALLY_TYPE, ALL_TYPES = 0, 1, 2, 255
"""MAV_MISSION_TYPE of mission, geofence and rally points, and of all kinds of plans."""

FRAME_GLOBAL, FRAME_LOCAL_NED, FRAME_MISSION = 0, 1, 2
"""MAV_FRAME of items with a global and a local position, and of items without a position."""

GLOBAL_FRAMES = frozenset((0, 3, 5, 6))
"""MAV_FRAME values of items with latitude and longitude (GLOBAL, GLOBAL_RELATIVE_ALT, and _INT).

Absolute and relative altitude are equal, because home is at the water surface."""

LOCAL_SCALE, GLOBAL_SCALE = 10**4, 10**7
"""Units of x and y per metre in a local frame, and per degree in a global frame."""

NOT_GIVEN = (1 << 31) - 1
"""Value of a latitude or longitude that is not given, in an item or a COMMAND_INT."""

LENGTH_ROUNDING_M, SPEED_ROUNDING_MPS = 1e-3, 1e-3
"""Tolerances of limits for the rounding of items and parameters to float32, which has steps of
0.5 mm at the maximum of FS_DEPTH_M (6000 m)."""

LOOP_ON = 100
"""Offset of the axis of USER_1 (SID_AXIS) with closed loop: the signal is added to its command."""


class MissionItem(NamedTuple):
    """One item of a mission, with the fields of MISSION_ITEM_INT."""

    sequence: int
    """Number of the item, from 0."""
    frame: int
    """MAV_FRAME of x, y and z."""
    command: int
    """MAV_CMD."""
    current: int = 0
    autocontinue: int = 1
    p1: float = 0.0
    """Parameters 1 to 4 of the command; NaN means not given."""
    p2: float = 0.0
    p3: float = 0.0
    p4: float = 0.0
    x: int = 0
    """Latitude in 1e-7 deg (global), north in 1e-4 m (local), or parameter 5 (no position)."""
    y: int = 0
    """Longitude in 1e-7 deg (global), east in 1e-4 m (local), or parameter 6 (no position)."""
    z: float = 0.0
    """Altitude (global frames) or depth (local frames), in m, or parameter 7 (no position)."""
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
    NAV_TAKEOFF = 22
    DO_ORBIT = 34
    NAV_DELAY = 93
    CONDITION_CHANGE_ALT = 113
    """Continue with the next item when the depth is reached."""
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_SET_RELAY = 181
    DO_FLIGHTTERMINATION = 185
    DO_CHANGE_ALTITUDE = 186
    DO_SET_ACTUATOR = 187
    DO_LAND_START = 189
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
    CONTROL_HIGH_LATENCY = 2600
    NAV_FENCE_POLYGON_VERTEX_INCLUSION = 5001
    NAV_FENCE_POLYGON_VERTEX_EXCLUSION = 5002
    NAV_FENCE_CIRCLE_INCLUSION = 5003
    NAV_FENCE_CIRCLE_EXCLUSION = 5004
    NAV_RALLY_POINT = 5100
    USER_1 = 31010
    """An excitation for system identification."""


def place_fault(item: MissionItem) -> tuple[int, str]:
    """Check the latitude and longitude of an item with a position.

    Parameters
    ----------
    item : MissionItem
        The item; an item in a local frame has no fault.

    Returns
    -------
    parameter : int
        Number of the wrong parameter as in MAV_MISSION_RESULT: 5 for x, 6 for y; 0 for no fault.
    reason : str
        Reason with value and limits; "" for no fault.
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
