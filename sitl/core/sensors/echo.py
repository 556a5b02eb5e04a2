"""Ranges of sonar beams to the sea floor."""

from __future__ import annotations

from math import acos, cos, sin

import numpy as np

from mavlink_io.frames import Quaternion, Vector, flip, rotate
from mavlink_io.jit import entry_point
from sitl.core.environment import Environment, floor, floor_range_m
from sitl.core.environment.floor import SeaFloor
from sitl.vehicle.vectors import Vector as Array

DOWN: Vector = (0.0, 0.0, 1.0)
"""Down axis, in FRD and in NED."""


@entry_point
def ranges_m(
    ground: SeaFloor, position_ned_m: Vector, attitude_q: Quaternion, beams: tuple[Vector, ...]
) -> Array:
    """Return the distances (m) along unit vectors (FRD) to the floor; infinite without a hit."""
    ranges = np.empty(len(beams))
    origin = flip(position_ned_m[0], position_ned_m[1], position_ned_m[2])
    for i in range(len(beams)):
        north, east, down = rotate(attitude_q, beams[i])
        ranges[i] = floor.range_m(ground, origin, flip(north, east, down))
    return ranges


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
