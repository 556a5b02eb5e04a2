"""What bounds the water: ice or the surface above, the sea floor below. FLU axes.

Ice and floor push where nose or tail touch them, and rub. They and the surface draw a hull that
moves along them (``walls``). The surface is such a wall as long as waves of the hull's own making
are short against its depth: gravity holds it flat. A dipole under a surface feels, against one
under a rigid lid, 1.1 of its pull at a Froude number U / sqrt(g h) of 0.2 and 1.3 at 0.3, then up
to 3 times and from 0.85 on a push (Havelock's reflection (k_0 + k)/(k_0 - k) with k_0 = g / U^2
sec^2, integrated). Here it counts once up to 0.5 and no more from 0.85 on.

No boundary gives energy: contact is a damped spring that never pulls, rubbing opposes motion, and
what the pull of a wall does in drawing the hull closer is taken from her way."""

from __future__ import annotations

from math import sqrt

from sitl.vehicle import restoring
from sitl.vehicle.jit import Vector, Vector3, Wrench, kernel
from sitl.vehicle.model import Hydrostatics, Walls
from sitl.vehicle.water import Water

CONTACT_STIFFNESS_PER_S2 = 100.0
"""Of each end of the hull, per kilogram of vehicle: ten radians a second, stiff to a vehicle and
slow to a step."""
CONTACT_DAMPING_PER_S = 10.0
FRICTION = 0.2
"""Of wet hull on ice or sediment; assumed."""
CREEP_MPS = 0.02
"""Rubbing falls off below this speed, instead of holding the hull fast."""
STIFF_FROUDE, SOFT_FROUDE = 0.5, 0.85
"""On depth: up to the first the surface is a wall, from the second on it is none."""

RotationRows = tuple[Vector3, Vector3, Vector3]
"""R, body FLU to NWU, row by row."""


@kernel
def wrench(
    state: Vector,
    rows: RotationRows,
    nu_r: Wrench,
    water: Water,
    hydrostatics: Hydrostatics,
    walls: Walls,
) -> Wrench:
    """Contact and pull of floor, ice and surface, N and N m about the origin; ``nu_r`` is velocity
    through it."""
    up = rows[2]
    lid = min(water.ceiling_m, water.surface_m) - state[2]
    ground = (state[2] - water.floor_m) * water.floor_normal[2]
    if min(lid, ground) > walls.far_m + hydrostatics.half_length_m:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    n = water.floor_normal
    floor = (
        rows[0][0] * n[0] + rows[1][0] * n[1] + rows[2][0] * n[2],
        rows[0][1] * n[0] + rows[1][1] * n[1] + rows[2][1] * n[2],
        rows[0][2] * n[0] + rows[1][2] * n[1] + rows[2][2] * n[2],
    )
    down = (-up[0], -up[1], -up[2])
    share = 1.0
    if water.surface_m <= water.ceiling_m:
        share = _stiffness(nu_r[0], lid, hydrostatics)
    X = Y = Z = M = N = 0.0
    # One body of code for both sides: written out twice the step outgrows the compiler and costs
    # two and a half times.
    for side in range(2):
        above = side == 0
        normal = down if above else floor
        touch = _contact(
            state, normal, water.ceiling_m - state[2] if above else ground, hydrostatics
        )
        pull = _suction(
            nu_r, normal, lid if above else ground, share if above else 1.0, walls, hydrostatics
        )
        X += touch[0] + pull[0]
        Y += touch[1] + pull[1]
        Z += touch[2] + pull[2]
        M += touch[4] + pull[4]
        N += touch[5] + pull[5]
    return X, Y, Z, 0.0, M, N


@kernel
def _stiffness(u: float, depth_m: float, hydrostatics: Hydrostatics) -> float:
    """How far the surface acts as a wall, 0 to 1; not on what stands out of it."""
    deep_m = max(depth_m, hydrostatics.radius_m)
    froude = abs(u) / sqrt(hydrostatics.gravity_mps2 * deep_m)
    flat = min(1.0, max(0.0, (SOFT_FROUDE - froude) / (SOFT_FROUDE - STIFF_FROUDE)))
    return flat * restoring.immersion(-depth_m, hydrostatics.radius_m)


@kernel
def _contact(
    state: Vector, normal: Vector3, distance_m: float, hydrostatics: Hydrostatics
) -> Wrench:
    """Push and rubbing of a wall ``distance_m`` from the origin on nose and tail, rounded with the
    hull's radius.

    ``normal`` points out of the wall, body axes.
    """
    X = Y = Z = M = N = 0.0
    nx, ny, nz = normal
    arm = hydrostatics.half_length_m - hydrostatics.radius_m
    if distance_m - abs(nx) * arm < hydrostatics.radius_m:
        half_kg = 0.5 * hydrostatics.weight_n / hydrostatics.gravity_mps2
        for end in (1.0, -1.0):
            x = end * arm
            into = hydrostatics.radius_m - distance_m - nx * x
            if into > 0.0:
                u, v, w = state[7], state[8] + x * state[12], state[9] - x * state[11]
                leaving = nx * u + ny * v + nz * w
                push = half_kg * max(
                    0.0, CONTACT_STIFFNESS_PER_S2 * into - CONTACT_DAMPING_PER_S * leaving
                )
                u, v, w = u - leaving * nx, v - leaving * ny, w - leaving * nz
                rub = FRICTION * push / sqrt(u * u + v * v + w * w + CREEP_MPS * CREEP_MPS)
                fy, fz = push * ny - rub * v, push * nz - rub * w
                X += push * nx - rub * u
                Y += fy
                Z += fz
                M -= x * fz
                N += x * fy
    return X, Y, Z, 0.0, M, N


@kernel
def _suction(
    nu_r: Wrench,
    normal: Vector3,
    distance_m: float,
    share: float,
    walls: Walls,
    hydrostatics: Hydrostatics,
) -> Wrench:
    """What draws a moving hull to a wall, less what it costs her way; work-free to rounding."""
    if distance_m >= walls.far_m or share == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    nearness = hydrostatics.radius_m / max(distance_m, hydrostatics.radius_m)
    place = (nearness - walls.far_nearness) * walls.steps_per_nearness
    i = min(int(place), walls.pull_kgpm.size - 2)
    part = place - i
    u, v, w, _, q, r = nu_r
    nx, ny, nz = normal
    # The speed along the wall counts, not that towards it.
    along = share * (1.0 - nx * nx)
    force = along * (walls.pull_kgpm[i] + part * (walls.pull_kgpm[i + 1] - walls.pull_kgpm[i]))
    moment = along * (walls.moment_kg[i] + part * (walls.moment_kg[i + 1] - walls.moment_kg[i]))
    work = moment * (nz * q - ny * r) - force * (nx * u + ny * v + nz * w)
    square = u * u
    return (
        -force * square * nx - work * u,
        -force * square * ny,
        -force * square * nz,
        0.0,
        moment * square * nz,
        -moment * square * ny,
    )
