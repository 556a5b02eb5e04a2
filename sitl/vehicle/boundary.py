"""Forces of the boundaries of the water: ice or free surface above, sea floor below. FLU axes.

Contact: ice and floor push on nose and tail where they touch, with friction. Per end of the hull,
with mass m of the vehicle, penetration d (m) and speed away from the wall s (m/s),

    push = m/2 max(0, CONTACT_STIFFNESS_PER_S2 d - CONTACT_DAMPING_PER_S s),
    friction = FRICTION push V_t / sqrt(|V_t|^2 + CREEP_MPS^2), against the tangential velocity V_t.

Suction: ice, floor and surface attract a hull that moves along them (``wall_effects``).

The free surface acts as a rigid wall while the hull's own waves are short compared with its depth
h, because gravity keeps the surface flat. For a dipole under a free surface the ratio of the pull
to that under a rigid wall is 1.1 at a Froude number U / sqrt(g h) of 0.2 and 1.3 at 0.3; it rises
to 3 and becomes negative (a push) from 0.85 on (Havelock's reflection (k_0 + k)/(k_0 - k) with
k_0 = g / U^2 sec^2, integrated). The model uses a ratio of 1 up to Froude number 0.5, 0 from 0.85
on, and a straight line between.

No boundary adds energy: contact is a damped spring that only pushes, friction opposes motion, and
the work of the suction is subtracted from the forward motion of the vehicle.
"""

from __future__ import annotations

from math import sqrt

from mavlink_io.jit import kernel
from sitl.vehicle import restoring
from sitl.vehicle.model import Hydrostatics, Walls
from sitl.vehicle.vectors import Vector, Vector3, Wrench
from sitl.vehicle.water import Water

CONTACT_STIFFNESS_PER_S2 = 100.0
"""Contact stiffness of one end of the hull per kilogram on it: a natural frequency of 10 rad/s.

This is stiff for a vehicle and slow compared with the integration step."""
CONTACT_DAMPING_PER_S = 10.0
"""Contact damping of one end of the hull per kilogram on it; damping ratio 0.5."""
FRICTION = 0.2
"""Friction coefficient of a wet hull on ice or sediment, dimensionless; assumed."""
CREEP_MPS = 0.02
"""Tangential speed below which friction fades to zero, so that no static friction is needed."""
STIFF_FROUDE, SOFT_FROUDE = 0.5, 0.85
"""Froude numbers on depth: up to the first the surface acts as a wall, from the second not at all.
"""

RotationRows = tuple[Vector3, Vector3, Vector3]
"""Rows of R, body FLU to NWU."""


@kernel
def wrench(
    state: Vector,
    rows: RotationRows,
    nu_r: Wrench,
    water: Water,
    hydrostatics: Hydrostatics,
    walls: Walls,
) -> Wrench:
    """Return contact and suction of floor, ice and surface, N and N m about the origin, FLU.

    ``state`` has shape (13,), ``rows`` is the rotation matrix by rows, body FLU to NWU, and
    ``nu_r`` the velocity through the water.
    """
    # lid, ground: distances from the origin to the surface or ice above and to the floor below, m.
    # floor = R^T n, down = -R^T z: unit vectors out of each boundary, body axes.
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
    wall_share = 1.0
    if water.surface_m <= water.ceiling_m:
        wall_share = _stiffness(nu_r[0], lid, hydrostatics)
    X = Y = Z = M = N = 0.0
    # A loop over both sides, not code written twice: the compiler no longer inlines the larger
    # function, and a step takes 2.5 times as long.
    for side in range(2):
        is_lid = side == 0
        normal = down if is_lid else floor
        contact = _contact(
            state, normal, water.ceiling_m - state[2] if is_lid else ground, hydrostatics
        )
        suction = _suction(
            nu_r,
            normal,
            lid if is_lid else ground,
            wall_share if is_lid else 1.0,
            walls,
            hydrostatics,
        )
        X += contact[0] + suction[0]
        Y += contact[1] + suction[1]
        Z += contact[2] + suction[2]
        M += contact[4] + suction[4]
        N += contact[5] + suction[5]
    return X, Y, Z, 0.0, M, N


@kernel
def _stiffness(u: float, depth_m: float, hydrostatics: Hydrostatics) -> float:
    """Return the fraction, 0 to 1, to which the free surface acts as a wall on the hull.

    ``depth_m`` is that of the origin; sections above the surface do not count.
    """
    # Froude number Fr = |u| / sqrt(g h) with h no less than the hull radius; then a straight line
    # from 1 at STIFF_FROUDE to 0 at SOFT_FROUDE, times the immersed fraction of the section.
    h = max(depth_m, hydrostatics.radius_m)
    froude = abs(u) / sqrt(hydrostatics.gravity_mps2 * h)
    rigidity = min(1.0, max(0.0, (SOFT_FROUDE - froude) / (SOFT_FROUDE - STIFF_FROUDE)))
    return rigidity * restoring.immersion(-depth_m, hydrostatics.radius_m)


@kernel
def _contact(
    state: Vector, normal: Vector3, distance_m: float, hydrostatics: Hydrostatics
) -> Wrench:
    """Return push and friction of a wall on nose and tail, N and N m about the origin, FLU.

    Nose and tail are spheres of the hull's radius. ``normal`` is the unit vector out of the wall,
    body axes; ``distance_m`` is the distance of the origin from the wall.
    """
    # For each end at (x, 0, 0):
    #     penetration   into = R - distance - n_x x                                  m
    #     velocity      V = (u, v + x r, w - x q) over ground, V_n = n . V, V_t = V - V_n n
    #     push          m/2 max(0, CONTACT_STIFFNESS_PER_S2 into - CONTACT_DAMPING_PER_S V_n)   N
    #     friction      -FRICTION push V_t / sqrt(|V_t|^2 + CREEP_MPS^2)             N
    #     moments       M = -x Z, N = x Y
    X = Y = Z = M = N = 0.0
    nx, ny, nz = normal
    arm = hydrostatics.half_length_m - hydrostatics.radius_m
    if distance_m - abs(nx) * arm < hydrostatics.radius_m:
        half_kg = 0.5 * hydrostatics.weight_n / hydrostatics.gravity_mps2
        for end in (1.0, -1.0):
            x = end * arm
            penetration_m = hydrostatics.radius_m - distance_m - nx * x
            if penetration_m > 0.0:
                u, v, w = state[7], state[8] + x * state[12], state[9] - x * state[11]
                normal_mps = nx * u + ny * v + nz * w
                push = half_kg * max(
                    0.0,
                    CONTACT_STIFFNESS_PER_S2 * penetration_m - CONTACT_DAMPING_PER_S * normal_mps,
                )
                u, v, w = u - normal_mps * nx, v - normal_mps * ny, w - normal_mps * nz
                friction = FRICTION * push / sqrt(u * u + v * v + w * w + CREEP_MPS * CREEP_MPS)
                fy, fz = push * ny - friction * v, push * nz - friction * w
                X += push * nx - friction * u
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
    wall_share: float,
    walls: Walls,
    hydrostatics: Hydrostatics,
) -> Wrench:
    """Return the suction of a wall on a moving hull, N and N m about the origin, FLU.

    The wrench does no work, to rounding. ``share`` is the fraction to which the boundary acts as a
    wall, ``normal`` the unit vector out of it and ``distance_m`` its distance from the origin.
    """
    # nearness s = R / distance; force F(s) and moment Mo(s) per u^2 from the table ``walls``
    # (slender-body theory, Newman 1965; see ``wall_effects``), by linear interpolation.
    #     force  = -share (1 - n_x^2) F u^2 n,
    #     moment = share (1 - n_x^2) Mo u^2 (0, n_z, -n_y).
    # work u^2 is the power of the two; the force -work u along x takes it back, so the sum is zero.
    if distance_m >= walls.far_m or wall_share == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    nearness = hydrostatics.radius_m / max(distance_m, hydrostatics.radius_m)
    position = (nearness - walls.far_nearness) * walls.steps_per_nearness
    i = min(int(position), walls.pull_kgpm.size - 2)
    remainder = position - i
    u, v, w, _, q, r = nu_r
    nx, ny, nz = normal
    # Only the component of the velocity along the wall has an effect: the factor 1 - n_x^2.
    weight = wall_share * (1.0 - nx * nx)
    force = weight * (
        walls.pull_kgpm[i] + remainder * (walls.pull_kgpm[i + 1] - walls.pull_kgpm[i])
    )
    moment = weight * (
        walls.moment_kg[i] + remainder * (walls.moment_kg[i + 1] - walls.moment_kg[i])
    )
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
