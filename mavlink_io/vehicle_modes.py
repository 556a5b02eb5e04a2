"""Numbers of the vehicle's modes in HEARTBEAT and CURRENT_MODE.

This module does not import the MAVLink dialect, so that the pure tick can use it.
"""

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


ARDUPILOT = 3
"""MAV_AUTOPILOT_ARDUPILOTMEGA: the vehicle numbers its modes as ArduSub."""
ARDUSUB_NUMBERS = {
    VehicleMode.STABILIZE: 0,
    VehicleMode.DEPTH: 2,
    VehicleMode.MISSION: 3,
    VehicleMode.HOLD: 4,
    VehicleMode.OFFBOARD: 4,
    VehicleMode.RTL: 6,
    VehicleMode.SURFACE: 9,
    VehicleMode.STATION: 16,
    VehicleMode.MANUAL: 19,
    VehicleMode.SYSID: 25,
}
"""``custom_mode`` of each mode in ArduSub's numbering (ArduPilot, ArduSub/mode.h).

ArduSub's GUIDED (4) waits for set-points and follows them: HOLD and OFFBOARD. ArduSub has no modes
for RTL and SYSID: they have the numbers of ArduCopter.
"""
_ARDUSUB_MODES = {number: mode for mode, number in reversed(ARDUSUB_NUMBERS.items())}


PX4_HIGH_LATENCY_SHIFT = 16
"""Lowest bit of PX4's ``custom_mode`` that HIGH_LATENCY2 contains; ArduPilot's has all of it."""


def from_high_latency(autopilot: int, custom_mode: int) -> int:
    """Return the ``custom_mode`` of HEARTBEAT for that of HIGH_LATENCY2.

    Parameters
    ----------
    autopilot : int
        MAV_AUTOPILOT: it selects the numbering.
    custom_mode : int
        Number in HIGH_LATENCY2, 16 bits.

    Returns
    -------
    int
        Number in HEARTBEAT.
    """
    return custom_mode if autopilot == ARDUPILOT else custom_mode << PX4_HIGH_LATENCY_SHIFT


def mode_of_heartbeat(autopilot: int, custom_mode: int) -> VehicleMode | None:
    """Return the mode of a HEARTBEAT.

    Parameters
    ----------
    autopilot : int
        MAV_AUTOPILOT: it selects the numbering.
    custom_mode : int
        Number of the mode.

    Returns
    -------
    VehicleMode or None
        The mode; None if it is unknown. GUIDED of ArduSub is HOLD.
    """
    if autopilot == ARDUPILOT:
        return _ARDUSUB_MODES.get(custom_mode)
    try:
        return VehicleMode(custom_mode)
    except ValueError:
        return None
