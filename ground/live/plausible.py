"""Decode telemetry for display, with NaN for values that are unknown or that no vehicle has.

MAVLink marks many unknown integers by the largest number of their type, and a faulty sender may
send any number. Both lie outside the limits of this module, which have the units of the fields.
"""

import math
from collections.abc import Mapping
from typing import Any

from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.mission_items import GLOBAL_SCALE

MAX_ANGLE_RAD = 1e3
"""Maximum angle: some vehicles count turns instead of wrapping, here up to 159 of them."""
MAX_QUATERNION = 1.1
"""Maximum component of a unit quaternion, with a margin for a poor normalisation."""
MAX_DISTANCE_M = 1e6
"""Maximum distance from the origin: a local frame is flat, and useless before 1000 km."""
MAX_DEPTH_M, MAX_ALTITUDE_M = 12e3, 100e3
"""Maximum depth, as the deepest sea has 11 km, and maximum altitude, where space begins."""
MAX_SPEED_MPS = 1e3
"""Maximum speed, about three times the speed of sound in air."""
MIN_PULSE_US, MAX_PULSE_US = 500.0, 2500.0
"""Pulse widths that servos and speed controllers accept."""
MAX_OUTPUT = 1.1
"""Maximum of an output that is normalised to 1, with a margin for trims."""
MAX_KNOWN_U16 = 65_534
"""Maximum of an unsigned 16-bit field in which 65535 means unknown."""

Limits = tuple[float, float]
_ANGLE, _COMPONENT = (-MAX_ANGLE_RAD, MAX_ANGLE_RAD), (-MAX_QUATERNION, MAX_QUATERNION)
_HORIZONTAL, _SPEED = (-MAX_DISTANCE_M, MAX_DISTANCE_M), (-MAX_SPEED_MPS, MAX_SPEED_MPS)
_DOWN, _UP = (-MAX_ALTITUDE_M, MAX_DEPTH_M), (-MAX_DEPTH_M, MAX_ALTITUDE_M)
_LIMITS: Mapping[str, Mapping[str, Limits]] = {
    "ATTITUDE": dict.fromkeys(("roll", "pitch", "yaw"), _ANGLE),
    "ATTITUDE_QUATERNION": dict.fromkeys(("q1", "q2", "q3", "q4"), _COMPONENT),
    "ATTITUDE_TARGET": {"q": _COMPONENT},
    "LOCAL_POSITION_NED": {"x": _HORIZONTAL, "y": _HORIZONTAL, "z": _DOWN},
    "POSITION_TARGET_LOCAL_NED": {"z": _DOWN},
    "GLOBAL_POSITION_INT": {
        "lat": (-90.0 * GLOBAL_SCALE, 90.0 * GLOBAL_SCALE),
        "lon": (-180.0 * GLOBAL_SCALE, 180.0 * GLOBAL_SCALE),
        "relative_alt": (1e3 * _UP[0], 1e3 * _UP[1]),
        "hdg": (0, 36_000),
    },
    "VFR_HUD": {"airspeed": _SPEED, "groundspeed": _SPEED, "climb": _SPEED, "alt": _UP},
    "GPS_RAW_INT": {"fix_type": (0, constant("GPS_FIX_TYPE_PPP"))},
    "ACTUATOR_OUTPUT_STATUS": {"actuator": (-MAX_OUTPUT, MAX_OUTPUT)},
    "SERVO_OUTPUT_RAW": {
        f"servo{number}_raw": (MIN_PULSE_US, MAX_PULSE_US) for number in range(1, 17)
    },
    "MISSION_CURRENT": {"seq": (0, MAX_KNOWN_U16)},
    "NAV_CONTROLLER_OUTPUT": {"target_bearing": (-360, 360), "wp_dist": (0, MAX_KNOWN_U16)},
}
"""Limits of the fields that are shown, by message; of an array for each of its numbers."""


def decode(frame: Frame) -> Any:
    """Return the message of a frame, with NaN in fields outside their limits.

    Parameters
    ----------
    frame : Frame
        Frame of a message that the dialect defines.

    Returns
    -------
    Message
        Named tuple; a field whose value is unknown or impossible is NaN.
    """
    message = frame.decode()
    limits = _LIMITS.get(frame.name)
    if limits is None:
        return message
    return message._replace(
        **{name: _known(getattr(message, name), *limits[name]) for name in limits}
    )


def _known(value: Any, low: float, high: float) -> Any:
    """Return a number, or the numbers of an array, with NaN outside the limits.

    Zero is always accepted: a servo output of 0 us is off.
    """
    if isinstance(value, tuple):
        return tuple(_known(number, low, high) for number in value)
    return value if value == 0 or low <= value <= high else math.nan
