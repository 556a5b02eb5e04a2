"""Water that varies in space and time: its properties at the hull, in one compiled call."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from mavlink_io.jit import entry_point, kernel
from sitl.core.environment import current, density, floor, waves
from sitl.core.environment.floor import SeaFloor
from sitl.vehicle.dynamics import rotation
from sitl.vehicle.vectors import Vector, Vector3
from sitl.vehicle.water import Water

_GAUSS = sqrt(3.0 / 5.0)
_OUTER, _MIDDLE = 5.0 / 18.0, 8.0 / 18.0
"""Three-point Gauss-Legendre rule on [-1, 1]: outer abscissa, and weights of a mean."""


class WaterField(NamedTuple):
    """Water that varies in space and time, in NWU axes."""

    sea: Vector
    """Wave components of ``waves.draw_components``, one row each."""
    profile: Vector
    """Current over depth, of ``current.profile``."""
    column: Vector
    """Density and pressure over depth, of ``density.column``."""
    floor: SeaFloor
    ceiling_m: float
    """Height of the underside of ice (negative); infinite without ice."""
    gravity_mps2: float
    ballast_density_kgpm3: float
    """Density in which the vehicle was ballasted."""
    half_length_m: float
    """Half the length of the hull."""


class LocalWater(NamedTuple):
    """Water around the vehicle at one instant."""

    water: Water
    wave_pressure_pa: float
    """Pressure due to waves at the origin of the body."""


@kernel
def _advect(vector: Vector3, gradient: waves.WaveKinematics) -> Vector3:
    """Return (vector . grad) w, with the gradient of the wave velocity w."""
    n, w, u = vector
    a, b, c = gradient.along_north, gradient.along_west, gradient.along_up
    return (
        n * a[0] + w * b[0] + u * c[0],
        n * a[1] + w * b[1] + u * c[1],
        n * a[2] + w * b[2] + u * c[2],
    )


@kernel
def flow(
    field: WaterField, point: Vector3, time_s: float, variation: Vector3, variation_rate: Vector3
) -> tuple[Vector3, Vector3, waves.WaveKinematics]:
    """Return velocity (m/s) and acceleration Dv/Dt (m/s2) of the water, and the waves, at a point.

    With the steady current U(z), U_0 = U(0), its variation V(t) and the wave velocity w, which is
    carried by U_0:

        v     = U(z) + V(t) + w(x - U_0 t, t)
        Dv/Dt = V' + dw/dt + ((v - U_0) . grad) w + w_z dU/dz
    """
    drift_n, drift_w, _, _ = current.steady_current(field.profile, 0.0)
    current_n, current_w, shear_n, shear_w = current.steady_current(field.profile, point[2])
    wave = waves.motion(
        field.sea, point[0] - drift_n * time_s, point[1] - drift_w * time_s, point[2], time_s
    )
    w = wave.velocity
    velocity = (current_n + variation[0] + w[0], current_w + variation[1] + w[1], w[2])
    advected = _advect((velocity[0] - drift_n, velocity[1] - drift_w, velocity[2]), wave)
    acceleration = (
        variation_rate[0] + wave.local_acceleration[0] + advected[0] + w[2] * shear_n,
        variation_rate[1] + wave.local_acceleration[1] + advected[1] + w[2] * shear_w,
        wave.local_acceleration[2] + advected[2],
    )
    return velocity, acceleration, wave


@kernel
def _mean(before: Vector3, middle: Vector3, after: Vector3) -> Vector3:
    """Return the mean along the hull from the values at the three Gauss points."""
    return (
        _OUTER * (before[0] + after[0]) + _MIDDLE * middle[0],
        _OUTER * (before[1] + after[1]) + _MIDDLE * middle[1],
        _OUTER * (before[2] + after[2]) + _MIDDLE * middle[2],
    )


@kernel
def _slope(behind: Vector3, ahead: Vector3, distance_m: float) -> Vector3:
    """Return the difference quotient of the values at the two outer Gauss points."""
    return (
        (ahead[0] - behind[0]) / distance_m,
        (ahead[1] - behind[1]) / distance_m,
        (ahead[2] - behind[2]) / distance_m,
    )


@entry_point
def sample(
    field: WaterField,
    body: Vector,
    ahead_s: float,
    time_s: float,
    variation: Vector3,
    variation_rate: Vector3,
) -> tuple[Water, float]:
    """Return the water around the hull and the pressure due to waves at its origin (Pa).

    ``body`` is the state of ``vehicle.dynamics``; its position is extrapolated by ``ahead_s``.
    ``variation`` and ``variation_rate`` are velocity and acceleration of the current's variation.

    Mean and slope along the hull come from Gauss points at s = -g, 0, g with g = sqrt(3/5) L/2:
    mean = (5 f(-g) + 8 f(0) + 5 f(g)) / 18, slope = (f(g) - f(-g)) / (2 g). They equal those of
    the least-squares line for any f up to a cubic.
    """
    rows = rotation(body)
    forward = (rows[0][0], rows[1][0], rows[2][0])
    origin = (
        body[0] + ahead_s * (rows[0][0] * body[7] + rows[0][1] * body[8] + rows[0][2] * body[9]),
        body[1] + ahead_s * (rows[1][0] * body[7] + rows[1][1] * body[8] + rows[1][2] * body[9]),
        body[2] + ahead_s * (rows[2][0] * body[7] + rows[2][1] * body[8] + rows[2][2] * body[9]),
    )
    arm = _GAUSS * field.half_length_m
    x, y, z = forward[0] * arm, forward[1] * arm, forward[2] * arm
    v_fore, a_fore, _ = flow(
        field, (origin[0] + x, origin[1] + y, origin[2] + z), time_s, variation, variation_rate
    )
    v_aft, a_aft, _ = flow(
        field, (origin[0] - x, origin[1] - y, origin[2] - z), time_s, variation, variation_rate
    )
    v, a, wave = flow(field, origin, time_s, variation, variation_rate)
    rho, _ = density.density_and_pressure(field.column, -origin[2], field.gravity_mps2)
    height, north_slope, west_slope = floor.height_and_slope(field.floor, origin[0], origin[1])
    water = Water(
        _mean(v_aft, v, v_fore),
        _mean(a_aft, a, a_fore),
        _slope(v_aft, v_fore, 2.0 * arm),
        _slope(a_aft, a_fore, 2.0 * arm),
        rho / field.ballast_density_kgpm3,
        wave.elevation_m,
        wave.rise_north * forward[0] + wave.rise_west * forward[1],
        field.ceiling_m,
        height,
        floor.normal(north_slope, west_slope),
    )
    return water, field.column[0, 1] * field.gravity_mps2 * wave.head_m
