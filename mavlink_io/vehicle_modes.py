"""Numbers of the vehicle's modes in HEARTBEAT and CURRENT_MODE."""

from enum import IntEnum


class VehicleMode(IntEnum):
    """``custom_mode`` of each mode, numbered as in PX4: main << 16 | sub << 24."""

    MANUAL = 1 << 16
    DEPTH = 2 << 16
    STATION = 3 << 16
    HOLD = 4 << 16 | 3 << 24
    MISSION = 4 << 16 | 4 << 24
    RTL = 4 << 16 | 5 << 24
    SURFACE = 4 << 16 | 6 << 24
    SYSID = 4 << 16 | 11 << 24
    OFFBOARD = 6 << 16
    STABILIZE = 7 << 16
