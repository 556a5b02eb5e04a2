"""The current: uniform or in layers, plus a slow variation uniform in space (NWU axes)."""

from __future__ import annotations

from math import cos, radians, sin
from typing import NamedTuple

import numpy as np

from mavlink_io.jit import kernel, numeric
from sitl.core.draws import DRIFT, Draws, DrawTable, draw
from sitl.core.environment.moments import SecondOrder, second_order, step_second_order
from sitl.environment_schema import CurrentConfig, Variation
from sitl.vehicle.vectors import Vector, Vector3

_CORRELATION_TIMES = 2.1461932
"""Root x of (1 + x) exp(-x) = 1/e: correlation time of a critically damped process times omega."""


class Drift(NamedTuple):
    """Variation of the current: a critically damped second-order process each for north and west.

    Its autocorrelation is (1 + omega t) exp(-omega t) (Gelb 1974, "Applied Optimal Estimation",
    table 2.2-1). A first-order process has no finite acceleration and therefore no pressure
    gradient that would accelerate the hull with the water.
    """

    process: SecondOrder
    omega_radps: float
    rms_mps: float
    """0 for a steady current."""


VARIATION = 4
"""Length of the variation's state: unit-variance (x, x'/omega) of north, then of west."""
STEADY = Drift(SecondOrder((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), 0.0, 0.0)
"""No variation."""


def profile(current: CurrentConfig) -> Vector:
    """Return the velocity over depth, shape (layers, 3): depth (m), north and west (m/s).

    The velocity is linear between rows. A layer with speed v towards bearing b has the components
    (v cos b, -v sin b).
    """
    rows = [(layer.depth_m, layer.speed_mps, layer.towards_deg) for layer in current.layer]
    rows = rows or [(0.0, current.speed_mps, current.towards_deg)]
    return np.array(
        [(z, v * cos(radians(towards)), -v * sin(radians(towards))) for z, v, towards in rows]
    )


@kernel
def steady_current(profile: Vector, z_m: float) -> tuple[float, float, float, float]:
    """Return (north, west) velocity (m/s) at the height ``z_m`` and its derivative by height (1/s).

    Linear interpolation in depth; constant, with zero derivative, above the first row and below the
    last.
    """
    # Row i of the profile: depth d_i (m), north n_i and west w_i (m/s). For d_i <= d < d_i+1:
    #     c(d) = c_i + (c_i+1 - c_i) / (d_i+1 - d_i) (d - d_i),   dc/dz = -dc/dd,   z = -d.
    depth, last = -z_m, len(profile) - 1
    if depth <= profile[0, 0]:
        return profile[0, 1], profile[0, 2], 0.0, 0.0
    for i in range(last):
        if depth < profile[i + 1, 0]:
            thickness = profile[i + 1, 0] - profile[i, 0]
            north, west = (
                (profile[i + 1, 1] - profile[i, 1]) / thickness,
                (profile[i + 1, 2] - profile[i, 2]) / thickness,
            )
            down = depth - profile[i, 0]
            return profile[i, 1] + north * down, profile[i, 2] + west * down, -north, -west
    return profile[last, 1], profile[last, 2], 0.0, 0.0


def current_drift(variation: Variation, tick_s: float) -> Drift:
    """Return the discretised variation; ``STEADY`` if the current is steady."""
    if not variation.rms_mps:
        return STEADY
    omega = _CORRELATION_TIMES / variation.time_constant_s
    return Drift(second_order(omega, 1.0, tick_s), omega, variation.rms_mps)


def sample_stationary(drift: Drift, stream: Draws) -> list[float]:
    """Draw a variation from its stationary distribution; zeros in a steady current."""
    return stream.normals(DRIFT, VARIATION) if drift.rms_mps else [0.0] * VARIATION


@numeric
def advance(drift: Drift, state: Vector, table: DrawTable) -> None:
    """Advance the variation by one tick, in place."""
    if drift.rms_mps > 0.0:
        for i in (0, 2):
            step_second_order(
                drift.process, state[i : i + 2], draw(table, DRIFT), draw(table, DRIFT)
            )


@numeric
def variation_motion(drift: Drift, state: Vector) -> tuple[Vector3, Vector3]:
    """Return velocity (m/s) and acceleration (m/s2) of the variation, NWU."""
    speed, rate = drift.rms_mps, drift.rms_mps * drift.omega_radps
    return (speed * state[0], speed * state[2], 0.0), (rate * state[1], rate * state[3], 0.0)
