"""Ranges of sonar beams to the sea floor."""

from __future__ import annotations

from math import acos, cos, sin

from mavlink_io.frames import Quaternion, Vector, flip, rotate
from mavlink_io.jit import entry_point, numeric
from sitl.core.environment import floor
from sitl.core.environment.floor import SeaFloor

DOWN: Vector = (0.0, 0.0, 1.0)
"""Down axis, in FRD and in NED."""


@numeric
def range_m(ground: SeaFloor, position_ned_m: Vector, direction_ned: Vector) -> float:
    """Return the distance (m) to the sea floor along a unit vector; infinite without a hit."""
    north_m, east_m, down_m = position_ned_m
    north, east, down = direction_ned
    return floor.range_m(ground, flip(north_m, east_m, down_m), flip(north, east, down))


@numeric
def tilt_cos(attitude_q: Quaternion) -> float:
    """Return the cosine of the angle between the vehicle's down axis and the vertical."""
    return rotate(attitude_q, DOWN)[2]


@entry_point
def first_echo_m(
    ground: SeaFloor, position_ned_m: Vector, attitude_q: Quaternion, half_width_rad: float
) -> float:
    """Return the distance (m) to the floor along the ray of a conical beam nearest to the vertical.

    The beam axis is the vehicle's down axis. Over a floor that is nearly level the first echo comes
    from this ray.
    """
    north, east, down = rotate(attitude_q, DOWN)
    tilt = acos(max(-1.0, min(1.0, down)))
    if tilt <= half_width_rad:
        return range_m(ground, position_ned_m, DOWN)
    ratio = sin(tilt - half_width_rad) / sin(tilt)
    return range_m(
        ground, position_ned_m, (north * ratio, east * ratio, cos(tilt - half_width_rad))
    )
