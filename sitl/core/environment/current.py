"""The current: steady or in layers, and a slow variation of the whole water on top. NWU axes."""

from __future__ import annotations

from math import cos, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from sitl.core.environment.moments import SecondOrder, second_order, step_second_order
from sitl.environment_schema import Current, Variation
from sitl.vehicle.jit import Vector, Vector3, kernel

_CORRELATION_TIMES = 2.1461932
"""(1 + x) exp(-x) = 1/e: what a critically damped process forgets in, in units of 1/omega."""


class Drift(NamedTuple):
    """The variation over one tick: a critically damped second-order Gauss-Markov process for each
    of north and west.

    The first-order one has no acceleration, so the hull in it could not ride along as a hull in
    water does. Gelb (1974, "Applied Optimal Estimation", table 2.2-1) gives this one's correlation:
    (1 + omega t) exp(-omega t)."""

    process: SecondOrder
    omega_radps: float
    rms_mps: float


class CurrentVariation(NamedTuple):
    """The variation at one instant: unit states (x, x'/omega) of north and west."""

    north: tuple[float, float]
    west: tuple[float, float]


def profile(current: Current) -> Vector:
    """Velocity over depth, shape (layers, 3): depth in m, north and west in m/s; linear between the
    rows."""
    rows = [(layer.depth_m, layer.speed_mps, layer.towards_deg) for layer in current.layer]
    rows = rows or [(0.0, current.speed_mps, current.towards_deg)]
    return np.array(
        [(z, v * cos(radians(towards)), -v * sin(radians(towards))) for z, v, towards in rows]
    )


@kernel
def steady_current(profile: Vector, z_m: float) -> tuple[float, float, float, float]:
    """(north, west) velocity at the height ``z_m`` and its increase per metre upwards, m/s and
    1/s."""
    depth, last = -z_m, len(profile) - 1
    if depth <= profile[0, 0]:
        return profile[0, 1], profile[0, 2], 0.0, 0.0
    for i in range(last):
        if depth < profile[i + 1, 0]:
            thick = profile[i + 1, 0] - profile[i, 0]
            north, west = (
                (profile[i + 1, 1] - profile[i, 1]) / thick,
                (profile[i + 1, 2] - profile[i, 2]) / thick,
            )
            down = depth - profile[i, 0]
            return profile[i, 1] + north * down, profile[i, 2] + west * down, -north, -west
    return profile[last, 1], profile[last, 2], 0.0, 0.0


def current_drift(variation: Variation, tick_s: float) -> Drift | None:
    """None where the current is steady."""
    if not variation.rms_mps:
        return None
    omega = _CORRELATION_TIMES / variation.time_constant_s
    return Drift(second_order(omega, 1.0, tick_s), omega, variation.rms_mps)


def sample_stationary(stream: Generator) -> CurrentVariation:
    """A draw from the stationary distribution."""
    a, b, c, d = stream.standard_normal(4).tolist()
    return CurrentVariation((a, b), (c, d))


def advance(drift: Drift, swerve: CurrentVariation, stream: Generator) -> CurrentVariation:
    """The variation one tick later."""
    a, b, c, d = stream.standard_normal(4).tolist()
    return CurrentVariation(
        step_second_order(drift.process, swerve.north, a, b),
        step_second_order(drift.process, swerve.west, c, d),
    )


def variation_motion(drift: Drift, swerve: CurrentVariation) -> tuple[Vector3, Vector3]:
    """Velocity and acceleration of the variation, m/s and m/s2."""
    speed, rate = drift.rms_mps, drift.rms_mps * drift.omega_radps
    (north, north_rate), (west, west_rate) = swerve
    return (speed * north, speed * west, 0.0), (rate * north_rate, rate * west_rate, 0.0)
