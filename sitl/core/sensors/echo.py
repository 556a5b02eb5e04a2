"""Ranges of sonar beams to the sea floor."""

from __future__ import annotations

from math import acos, cos, sin

from mavlink_io.frames import Quaternion, Vector, rotate
from sitl.core.environment import Environment, floor_range_m

DOWN: Vector = (0.0, 0.0, 1.0)
"""Down axis, in FRD and in NED."""


def range_m(
    sea: Environment, position_ned_m: Vector, attitude_q: Quaternion, beam: Vector
) -> float:
    """Return the distance (m) along a unit vector ``beam`` (FRD) to the floor; infinite if none."""
    return floor_range_m(sea, position_ned_m, rotate(attitude_q, beam))


def tilt_cos(attitude_q: Quaternion) -> float:
    """Return the cosine of the angle between the vehicle's down axis and the vertical."""
    return rotate(attitude_q, DOWN)[2]


def first_echo_m(
    sea: Environment, position_ned_m: Vector, attitude_q: Quaternion, half_width_rad: float
) -> float:
    """Return the distance (m) to the floor along the ray of a conical beam nearest to the vertical.

    The beam axis is the vehicle's down axis. Over a floor that is nearly level the first echo comes
    from this ray.
    """
    north, east, down = rotate(attitude_q, DOWN)
    tilt = acos(max(-1.0, min(1.0, down)))
    if tilt <= half_width_rad:
        return floor_range_m(sea, position_ned_m, DOWN)
    ratio = sin(tilt - half_width_rad) / sin(tilt)
    return floor_range_m(
        sea, position_ned_m, (north * ratio, east * ratio, cos(tilt - half_width_rad))
    )
