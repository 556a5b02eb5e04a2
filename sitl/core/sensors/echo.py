"""Sound beams: where they hit the floor."""

from __future__ import annotations

from math import acos, cos, sin

from mavlink_io.frames import Quaternion, Vector, rotate
from sitl.core.environment import Environment, floor_range_m

DOWN: Vector = (0.0, 0.0, 1.0)


def range_m(
    sea: Environment, position_ned_m: Vector, attitude_q: Quaternion, beam: Vector
) -> float:
    """Distance along a unit ``beam`` (FRD) to the floor; infinite where it meets none."""
    return floor_range_m(sea, position_ned_m, rotate(attitude_q, beam))


def tilt_cos(attitude_q: Quaternion) -> float:
    """Cosine of the angle between the vehicle's down and the vertical."""
    return rotate(attitude_q, DOWN)[2]


def first_echo_m(
    sea: Environment, position_ned_m: Vector, attitude_q: Quaternion, half_width_rad: float
) -> float:
    """Distance to the floor along that ray of a cone about the vehicle's down which leans least
    from the vertical.

    Over a floor that is nearly level it returns first.
    """
    north, east, down = rotate(attitude_q, DOWN)
    tilt = acos(max(-1.0, min(1.0, down)))
    if tilt <= half_width_rad:
        return floor_range_m(sea, position_ned_m, DOWN)
    leaning = sin(tilt - half_width_rad) / sin(tilt)
    return floor_range_m(
        sea, position_ned_m, (north * leaning, east * leaning, cos(tilt - half_width_rad))
    )
