"""Six-degree-of-freedom equations of motion and their integration.

State vector, 13 floats: ``[0:3]`` position NWU (m), ``[3:7]`` quaternion w, x, y, z turning body
FLU into NWU, ``[7:13]`` nu = (u, v, w, p, q, r) **over ground** in body axes (m/s, rad/s)."""

from __future__ import annotations

from math import sqrt

import numpy as np

from sitl.vehicle import boundary, duct, fins, hydrodynamics, propeller, restoring
from sitl.vehicle.jit import Vector, Vector3, Wrench, entry_point, kernel
from sitl.vehicle.model import Inertia, VehicleModel
from sitl.vehicle.water import Water

STATE_SIZE = 13
POSITION = slice(0, 3)
QUATERNION = slice(3, 7)
NU = slice(7, 13)
STAGES = 5
"""Rows of the work array of ``rk4_step``: four slopes and the state between."""


def state_at_rest(z_up_m: float = 0.0) -> Vector:
    """State, shape (13,), of a level vehicle heading north, at rest ``z_up_m`` above the
    surface."""
    state = np.zeros(STATE_SIZE)
    state[2] = z_up_m
    state[3] = 1.0
    return state


def work_array() -> Vector:
    """Scratch space for ``rk4_step``, shape (5, 13); make it once, outside the loop."""
    return np.empty((STAGES, STATE_SIZE))


@kernel
def rotation(state: Vector) -> tuple[Vector3, Vector3, Vector3]:
    """Rows of R, body FLU to NWU; its last row is the inertial z axis in body axes (Fossen 2021,
    sec. 2.2)."""
    w, x, y, z = state[3], state[4], state[5], state[6]
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@kernel
def coriolis(nu: Wrench, inertia: Inertia) -> Wrench:
    """-C(nu) nu of body and entrained water together, N and N m; does no work.

    Kirchhoff's equations (Lamb 1932, sec. 124): momenta (P, H) = M nu give the wrench -(omega x P,
    omega x H + v x P)."""
    u, v, w, p, q, r = nu
    M = inertia.M
    px = M[0, 0] * u + M[0, 1] * v + M[0, 2] * w + M[0, 3] * p + M[0, 4] * q + M[0, 5] * r
    py = M[1, 0] * u + M[1, 1] * v + M[1, 2] * w + M[1, 3] * p + M[1, 4] * q + M[1, 5] * r
    pz = M[2, 0] * u + M[2, 1] * v + M[2, 2] * w + M[2, 3] * p + M[2, 4] * q + M[2, 5] * r
    hx = M[3, 0] * u + M[3, 1] * v + M[3, 2] * w + M[3, 3] * p + M[3, 4] * q + M[3, 5] * r
    hy = M[4, 0] * u + M[4, 1] * v + M[4, 2] * w + M[4, 3] * p + M[4, 4] * q + M[4, 5] * r
    hz = M[5, 0] * u + M[5, 1] * v + M[5, 2] * w + M[5, 3] * p + M[5, 4] * q + M[5, 5] * r
    return (
        r * py - q * pz,
        p * pz - r * px,
        q * px - p * py,
        (r * hy - q * hz) + (w * py - v * pz),
        (p * hz - r * hx) + (u * pz - w * px),
        (q * hx - p * hy) + (v * px - u * py),
    )


@kernel
def tail(
    nu: Wrench,
    axis: Vector3,
    rudder_rad: float,
    elevator_rad: float,
    shaft_rps: float,
    immersed: float,
    model: VehicleModel,
) -> Wrench:
    """Ring wing and propeller, both at the duct and along or about its axis, and fins; N and N m
    about the origin."""
    u, v, w, _, q, r = nu
    x = model.duct.x_m
    velocity = (u, v + x * r, w - x * q)
    fx, fy, fz = duct.force(velocity, axis, model.duct)
    along = velocity[0] * axis[0] + velocity[1] * axis[1] + velocity[2] * axis[2]
    thrust = propeller.thrust_n(shaft_rps, along, model.propeller)
    X = immersed * (fx + thrust * axis[0])
    Y = immersed * (fy + thrust * axis[1])
    Z = immersed * (fz + thrust * axis[2])
    finned = fins.wrench(nu, rudder_rad, elevator_rad, model.fins)
    return (
        X + immersed * finned[0],
        Y + immersed * finned[1],
        Z + immersed * finned[2],
        immersed * finned[3],
        -x * Z + immersed * finned[4],
        x * Y + immersed * finned[5],
    )


@kernel
def _in_body(rows: tuple[Vector3, Vector3, Vector3], vector_nwu: Vector3) -> Vector3:
    """R^T c: an inertial vector in body axes."""
    north, west, up = rows
    n, w, u = vector_nwu[0], vector_nwu[1], vector_nwu[2]
    return (
        north[0] * n + west[0] * w + up[0] * u,
        north[1] * n + west[1] * w + up[1] * u,
        north[2] * n + west[2] * w + up[2] * u,
    )


@kernel
def _line_rotation_rate(slope: Vector3) -> Vector3:
    """Rate of turn of the line of water along the hull whose velocity grows by ``slope`` per metre
    forward."""
    return 0.0, -slope[2], slope[1]


@kernel
def _sum(a: Wrench, b: Wrench) -> Wrench:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def _forces(
    state: Vector,
    rows: tuple[Vector3, Vector3, Vector3],
    nu_r: Wrench,
    water: Water,
    acceleration: Vector3,
    turning: Vector3,
    axis: Vector3,
    rudder_rad: float,
    elevator_rad: float,
    shaft_rps: float,
    model: VehicleModel,
) -> Wrench:
    """Coriolis, static, hull, tail and boundary forces, N and N m about the origin.

    ``nu_r`` is the velocity through the water at the origin; ``acceleration`` and ``turning`` are
    the water's, in body axes: what the hull meets along its length turns with the water, what its
    momentum is does not."""
    u, v, w, p, q, r = nu_r
    up = rows[2]
    met = (u, v, w, p, q - turning[1], r - turning[2])
    g = model.hydrostatics.gravity_mps2
    felt = (up[0] + acceleration[0] / g, up[1] + acceleration[1] / g, up[2] + acceleration[2] / g)
    z_m, climb = state[2] - water.surface_m, up[0] - water.surface_slope
    immersed = restoring.immersion(z_m + climb * model.duct.x_m, model.duct.radius_m)
    total = coriolis(nu_r, model.inertia)
    total = _sum(
        total,
        restoring.wrench(z_m, climb, felt, water.density_ratio, model.hydrostatics, model.stations),
    )
    total = _sum(total, hydrodynamics.crossflow_drag(v, w, met[4], met[5], model.stations))
    total = _sum(total, hydrodynamics.lift_and_drag(u, v, w, p, met[4], met[5], model.hull))
    total = _sum(total, tail(met, axis, rudder_rad, elevator_rad, shaft_rps, immersed, model))
    total = _sum(total, boundary.wrench(state, rows, nu_r, water, model.hydrostatics, model.walls))
    return _sum(
        total,
        hydrodynamics.duct_interaction(immersed * u * abs(u), rudder_rad, elevator_rad, model.hull),
    )


@kernel
def _kinematics(state: Vector, rows: tuple[Vector3, Vector3, Vector3], out: Vector) -> None:
    """Rates of position, R v, and quaternion, 1/2 q (0, omega) (Fossen 2021, sec. 2.2)."""
    e0, e1, e2, e3 = state[3], state[4], state[5], state[6]
    u, v, w, p, q, r = state[7], state[8], state[9], state[10], state[11], state[12]
    for i in range(3):
        out[i] = rows[i][0] * u + rows[i][1] * v + rows[i][2] * w
    out[3] = -0.5 * (e1 * p + e2 * q + e3 * r)
    out[4] = 0.5 * (e0 * p + e2 * r - e3 * q)
    out[5] = 0.5 * (e0 * q + e3 * p - e1 * r)
    out[6] = 0.5 * (e0 * r + e1 * q - e2 * p)


@kernel
def _slope(
    state: Vector,
    axis: Vector3,
    rudder_rad: float,
    elevator_rad: float,
    propeller_rps: float,
    disturbance: Vector,
    water: Water,
    model: VehicleModel,
    out: Vector,
) -> None:
    """State derivative for a duct whose axis is already known; see ``derivative``."""
    rows = rotation(state)
    c_x, c_y, c_z = _in_body(rows, water.velocity_mps)
    acceleration = _in_body(rows, water.acceleration_mps2)
    p, q, r = state[10], state[11], state[12]
    nu_r = (state[7] - c_x, state[8] - c_y, state[9] - c_z, p, q, r)
    turning = _line_rotation_rate(_in_body(rows, water.slope_per_s))
    f = _forces(
        state,
        rows,
        nu_r,
        water,
        acceleration,
        turning,
        axis,
        rudder_rad,
        elevator_rad,
        propeller_rps,
        model,
    )
    X, Y, Z = f[0] + disturbance[0], f[1] + disturbance[1], f[2] + disturbance[2]
    K, M, N = f[3] + disturbance[3], f[4] + disturbance[4], f[5] + disturbance[5]

    _kinematics(state, rows, out)
    W = model.inertia.M_inverse
    for i in range(6):
        out[7 + i] = (
            W[i, 0] * X + W[i, 1] * Y + W[i, 2] * Z + W[i, 3] * K + W[i, 4] * M + W[i, 5] * N
        )
    # nu' = nu_r' + d(R^T c)/dt = nu_r' + R^T c' - omega x R^T c (Fossen 2021, sec. 10.3); c' is the
    # water's own acceleration, not the one met along the body's path (Auton, Hunt and Prud'homme
    # 1988, J. Fluid Mech. 197).
    out[7] += acceleration[0] - (q * c_z - r * c_y)
    out[8] += acceleration[1] - (r * c_x - p * c_z)
    out[9] += acceleration[2] - (p * c_y - q * c_x)
    # A hull of the water's own inertia turns with the line of water it lies in.
    spinning_up = _line_rotation_rate(_in_body(rows, water.slope_rate_per_s2))
    out[11] += spinning_up[1]
    out[12] += spinning_up[2]


@entry_point
def derivative(
    state: Vector,
    rudder_rad: float,
    elevator_rad: float,
    propeller_rps: float,
    disturbance: Vector,
    water: Water,
    model: VehicleModel,
    out: Vector,
) -> None:
    """Write d(state)/dt, shape (13,), into ``out``.

    ``rudder_rad`` and ``elevator_rad`` are true duct angles: positive rudder turns the nose to
    starboard, positive elevator lifts it. ``propeller_rps`` is in rev/s. ``disturbance``, shape
    (6,), is an extra wrench on the body in FLU axes about the origin, N and N m.

    (M_RB + M_A) nu_r' = -C(nu_r) nu_r + hydrostatics + crossflow + hull + tail + boundary +
    disturbance, in a frame that moves with the water at the hull. Where the water accelerates so
    does that frame: gravity as felt in it is g - Dv/Dt, and weight and buoyancy turn with it. Exact
    for uniform water, first order in its change along the hull."""
    axis = duct.ring_axis(model.duct.vectored * rudder_rad, model.duct.vectored * elevator_rad)
    _slope(state, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, out)


@entry_point
def rk4_step(
    state: Vector,
    rudder_rad: float,
    elevator_rad: float,
    propeller_rps: float,
    disturbance: Vector,
    water: Water,
    dt: float,
    model: VehicleModel,
    work: Vector,
) -> None:
    """Advance ``state`` in place by ``dt`` seconds, inputs held; classical Runge-Kutta of order
    four.

    Arguments as for ``derivative``; ``work`` is a ``work_array()``. The step ends by normalising
    the quaternion."""
    axis = duct.ring_axis(model.duct.vectored * rudder_rad, model.duct.vectored * elevator_rad)
    k1, k2, k3, k4, between = work[0], work[1], work[2], work[3], work[4]
    _slope(state, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k1)
    for i in range(STATE_SIZE):
        between[i] = state[i] + 0.5 * dt * k1[i]
    _slope(between, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k2)
    for i in range(STATE_SIZE):
        between[i] = state[i] + 0.5 * dt * k2[i]
    _slope(between, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k3)
    for i in range(STATE_SIZE):
        between[i] = state[i] + dt * k3[i]
    _slope(between, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k4)
    for i in range(STATE_SIZE):
        state[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    norm = sqrt(
        state[3] * state[3] + state[4] * state[4] + state[5] * state[5] + state[6] * state[6]
    )
    for i in range(3, 7):
        state[i] /= norm


@entry_point
def specific_force(state: Vector, rate: Vector, model: VehicleModel) -> Vector3:
    """What an accelerometer at the origin reads, FLU axes, m/s2: v' + omega x v - g, ``rate`` from
    ``derivative``."""
    _, _, up = rotation(state)
    u, v, w, p, q, r = state[7], state[8], state[9], state[10], state[11], state[12]
    g = model.hydrostatics.gravity_mps2
    return (
        rate[7] + q * w - r * v + g * up[0],
        rate[8] + r * u - p * w + g * up[1],
        rate[9] + p * v - q * u + g * up[2],
    )
