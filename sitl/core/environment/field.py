"""The water where it is not the same everywhere: what the hull meets at a place and instant, in one
compiled call."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from sitl.core.environment import current, density, floor, waves
from sitl.core.environment.floor import SeaFloor
from sitl.vehicle.dynamics import rotation
from sitl.vehicle.jit import Native, Vector, Vector3, entry_point, kernel
from sitl.vehicle.water import Water

_GAUSS = sqrt(3.0 / 5.0)
_OUTER, _MIDDLE = 5.0 / 18.0, 8.0 / 18.0
"""Three Gauss points along the hull and their shares."""


class WaterField(NamedTuple):
    """Where the water changes from place to place and in time. NWU axes."""

    sea: Vector
    """Wave components as ``waves.draw`` has them; no rows where there are none."""
    profile: Vector
    """Of the current, as ``current.profile`` has it."""
    column: Vector
    """As ``density.column`` has it."""
    floor: SeaFloor
    ceiling_m: float
    gravity_mps2: float
    ballast_density_kgpm3: float
    half_length_m: float
    """Of the hull."""


class LocalWater(NamedTuple):
    """What the vehicle meets at one instant."""

    water: Water
    wave_pressure_pa: float
    """What the waves add to the still water's pressure at the origin."""


@kernel
def _advected(vector: Vector3, gradient: waves.WaveKinematics) -> Vector3:
    """(vector . grad) of the waves' velocity."""
    n, w, u = vector
    a, b, c = gradient.along_north, gradient.along_west, gradient.along_up
    return (
        n * a[0] + w * b[0] + u * c[0],
        n * a[1] + w * b[1] + u * c[1],
        n * a[2] + w * b[2] + u * c[2],
    )


@kernel
def flow(
    field: WaterField, point: Vector3, time_s: float, swerve: Vector3, swerving: Vector3
) -> tuple[Vector3, Vector3, waves.WaveKinematics]:
    """Velocity of the water at a point, its acceleration Dv/Dt, and the waves there.

    v = U(z) + V(t) + w(x - U_0 t, t), of which Dv/Dt = V' + w_t + ((v - U_0).grad) w + w_z dU/dz:
    current, its variation, and waves that ride on the current U_0 of the surface."""
    drift_n, drift_w, _, _ = current.steady_current(field.profile, 0.0)
    here_n, here_w, shear_n, shear_w = current.steady_current(field.profile, point[2])
    moved = waves.motion(
        field.sea, point[0] - drift_n * time_s, point[1] - drift_w * time_s, point[2], time_s
    )
    w = moved.velocity
    velocity = (here_n + swerve[0] + w[0], here_w + swerve[1] + w[1], w[2])
    carried = _advected((velocity[0] - drift_n, velocity[1] - drift_w, velocity[2]), moved)
    acceleration = (
        swerving[0] + moved.change[0] + carried[0] + w[2] * shear_n,
        swerving[1] + moved.change[1] + carried[1] + w[2] * shear_w,
        moved.change[2] + carried[2],
    )
    return velocity, acceleration, moved


@kernel
def _mean(before: Vector3, middle: Vector3, after: Vector3) -> Vector3:
    return (
        _OUTER * (before[0] + after[0]) + _MIDDLE * middle[0],
        _OUTER * (before[1] + after[1]) + _MIDDLE * middle[1],
        _OUTER * (before[2] + after[2]) + _MIDDLE * middle[2],
    )


@kernel
def _slope(behind: Vector3, ahead: Vector3, apart_m: float) -> Vector3:
    return (
        (ahead[0] - behind[0]) / apart_m,
        (ahead[1] - behind[1]) / apart_m,
        (ahead[2] - behind[2]) / apart_m,
    )


@entry_point
def sample(
    field: WaterField,
    body: Vector,
    ahead_s: float,
    time_s: float,
    swerve: Vector3,
    swerving: Vector3,
) -> tuple[Water, float]:
    """The water round the hull of ``body`` (state of ``vehicle.dynamics``) ``ahead_s`` on, and wave
    pressure there, Pa.

    ``swerve`` and ``swerving`` are the variation of the current and its rate. Mean and slope along
    the hull are those of a straight line through three Gauss points: the least-squares line of
    anything up to a cubic."""
    rows = rotation(body)
    forward = (rows[0][0], rows[1][0], rows[2][0])
    place = (
        body[0] + ahead_s * (rows[0][0] * body[7] + rows[0][1] * body[8] + rows[0][2] * body[9]),
        body[1] + ahead_s * (rows[1][0] * body[7] + rows[1][1] * body[8] + rows[1][2] * body[9]),
        body[2] + ahead_s * (rows[2][0] * body[7] + rows[2][1] * body[8] + rows[2][2] * body[9]),
    )
    arm = _GAUSS * field.half_length_m
    x, y, z = forward[0] * arm, forward[1] * arm, forward[2] * arm
    v_fore, a_fore, _ = flow(
        field, (place[0] + x, place[1] + y, place[2] + z), time_s, swerve, swerving
    )
    v_aft, a_aft, _ = flow(
        field, (place[0] - x, place[1] - y, place[2] - z), time_s, swerve, swerving
    )
    v, a, moved = flow(field, place, time_s, swerve, swerving)
    rho, _ = density.density_and_pressure(field.column, -place[2], field.gravity_mps2)
    height, north_slope, west_slope = floor.height_and_slope(field.floor, place[0], place[1])
    water = Water(
        _mean(v_aft, v, v_fore),
        _mean(a_aft, a, a_fore),
        _slope(v_aft, v_fore, 2.0 * arm),
        _slope(a_aft, a_fore, 2.0 * arm),
        rho / field.ballast_density_kgpm3,
        moved.elevation_m,
        moved.rise_north * forward[0] + moved.rise_west * forward[1],
        field.ceiling_m,
        height,
        floor.normal(north_slope, west_slope),
    )
    return water, field.column[0, 1] * field.gravity_mps2 * moved.head_m


@entry_point
def sample_native(
    field: Native, body: Vector, ahead_s: float, time_s: float, swerve: Vector3, swerving: Vector3
) -> tuple[Water, float]:
    """``sample`` of a field kept where compiled code can reach it."""
    return sample(field.value, body, ahead_s, time_s, swerve, swerving)
