"""Six-degree-of-freedom equations of motion and their integration.

State vector, 13 floats:

- ``[0:3]``: position of the origin in NWU (m), z up,
- ``[3:7]``: unit quaternion (w, x, y, z) of the rotation R from body FLU to NWU,
- ``[7:13]``: nu = (u, v, w, p, q, r), velocity **over ground** in body FLU axes (m/s, rad/s).

FLU is x forward, y port, z up, with the origin on the hull axis at mid-length: the axes of the
paper and of its Table 1. MAVLink's FRD axes do not occur in this package.

Equation of motion, in a frame that moves with the water at the hull:

    (M_RB + M_A) nu_r' = -C(nu_r) nu_r + tau_hydrostatic + tau_hull + tau_tail + tau_boundary
                         + tau_disturbance,

with nu_r the velocity through the water (Fossen 2021, sec. 10.3, and the paper, "Overall Vehicle
Modeling"). Where the water accelerates with Dv/Dt, effective gravity in this frame is g - Dv/Dt.
The equation is exact for uniform water and of first order in the change of the water's velocity
along the hull.
"""

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
"""Rows of the work array of ``rk4_step``: the four slopes k1 to k4 and an intermediate state."""


def state_at_rest(z_up_m: float = 0.0) -> Vector:
    """Return the state of a level vehicle that is at rest and heads north.

    Parameters
    ----------
    z_up_m : float
        Height of the origin above the still water level, m; negative under water.

    Returns
    -------
    ndarray, shape (13,)
        A new state vector; see the module docstring for its order.
    """
    state = np.zeros(STATE_SIZE)
    state[2] = z_up_m
    state[3] = 1.0
    return state


def work_array() -> Vector:
    """Return scratch space for ``rk4_step``, shape (5, 13); allocate it once, outside the loop."""
    return np.empty((STAGES, STATE_SIZE))


@kernel
def rotation(state: Vector) -> tuple[Vector3, Vector3, Vector3]:
    """Return the rows of the rotation matrix R from body FLU to NWU (Fossen 2021, sec. 2.2).

    Parameters
    ----------
    state : Vector
        State, shape (13,); elements 3 to 6 are the attitude quaternion (w, x, y, z).

    Returns
    -------
    tuple of Vector3
        Rows of R. The third row is the inertial z axis (up), expressed in body axes.
    """
    w, x, y, z = state[3], state[4], state[5], state[6]
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@kernel
def coriolis(nu: Wrench, inertia: Inertia) -> Wrench:
    """Return the Coriolis and centripetal wrench of the body and its added mass.

    Parameters
    ----------
    nu : tuple of 6 floats
        Velocity (u, v, w, p, q, r) through the water, FLU, m/s and rad/s.
    inertia : Inertia
        Mass matrices; M = M_RB + M_A is used.

    Returns
    -------
    tuple of 6 floats
        -C(nu) nu about the origin, FLU, N and N m; it does no work.

    Notes
    -----
    Kirchhoff's equations (Lamb 1932, sec. 124).
    """
    # M = M_RB + M_A (6 x 6), nu = (v, omega) in FLU axes, m/s and rad/s.
    # Kirchhoff's equations (Lamb 1932, sec. 124), with momenta about the origin
    #     (P, H) = M nu:
    #     force  = -omega x P,
    #     moment = -omega x H - v x P.
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
    """Return the wrench of ring wing, propeller and fins.

    Parameters
    ----------
    nu : tuple of 6 floats
        Velocity (u, v, w, p, q, r) relative to the water, FLU, m/s and rad/s.
    axis : tuple of 3 floats
        Unit vector along the ring, forward, FLU, from ``duct.ring_axis``.
    rudder_rad : float
        Rudder angle, rad; positive turns the nose to starboard.
    elevator_rad : float
        Elevator angle, rad; positive turns the nose up.
    shaft_rps : float
        Shaft speed, rev/s; negative is astern.
    immersed : float
        Fraction of the duct that is under water, 0 to 1.
    model : VehicleModel
        The vehicle.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.

    Notes
    -----
    ``duct.force``, ``propeller.thrust_n`` and ``fins.wrench`` have the equations and sources.
    """
    # Ring and thrust act at (x, 0, 0), x < 0. Velocity there: (u, v, w) + omega x (x, 0, 0).
    # Moment about the origin: (x, 0, 0) x (X, Y, Z) = (0, -x Z, x Y).
    u, v, w, _, q, r = nu
    x = model.duct.x_m
    velocity = (u, v + x * r, w - x * q)
    fx, fy, fz = duct.force(velocity, axis, model.duct)
    axial_mps = velocity[0] * axis[0] + velocity[1] * axis[1] + velocity[2] * axis[2]
    thrust = propeller.thrust_n(shaft_rps, axial_mps, model.propeller)
    X = immersed * (fx + thrust * axis[0])
    Y = immersed * (fy + thrust * axis[1])
    Z = immersed * (fz + thrust * axis[2])
    fin_wrench = fins.wrench(nu, rudder_rad, elevator_rad, model.fins)
    return (
        X + immersed * fin_wrench[0],
        Y + immersed * fin_wrench[1],
        Z + immersed * fin_wrench[2],
        immersed * fin_wrench[3],
        -x * Z + immersed * fin_wrench[4],
        x * Y + immersed * fin_wrench[5],
    )


@kernel
def _in_body(rows: tuple[Vector3, Vector3, Vector3], vector_nwu: Vector3) -> Vector3:
    """Return R^T c: a vector given in NWU axes, expressed in body FLU axes."""
    north, west, up = rows
    n, w, u = vector_nwu[0], vector_nwu[1], vector_nwu[2]
    return (
        north[0] * n + west[0] * w + up[0] * u,
        north[1] * n + west[1] * w + up[1] * u,
        north[2] * n + west[2] * w + up[2] * u,
    )


@kernel
def _line_rotation_rate(slope: Vector3) -> Vector3:
    """Return the angular velocity of the water along the hull, body axes, rad/s.

    ``slope`` is the change of the water's velocity per metre forward, body axes, 1/s: a line of
    water that lies along x turns with omega = (0, -dw/dx, dv/dx).
    """
    return 0.0, -slope[2], slope[1]


@kernel
def _sum(a: Wrench, b: Wrench) -> Wrench:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def _forces(
    state: Vector,
    rows: tuple[Vector3, Vector3, Vector3],
    nu_r: Wrench,
    water: Water,
    acceleration: Vector3,
    water_omega: Vector3,
    axis: Vector3,
    rudder_rad: float,
    elevator_rad: float,
    shaft_rps: float,
    model: VehicleModel,
) -> Wrench:
    """Return the sum of all forces except the disturbance, N and N m about the origin, FLU.

    ``nu_r`` is the velocity through the water at the origin; ``acceleration`` (m/s2) and
    ``water_omega`` (rad/s) are those of the water, in body axes.
    """
    # Forces that depend on the flow along the hull use the angular velocity relative to the water,
    # omega - omega_water. The momentum in -C(nu_r) nu_r uses omega itself.
    # Effective "up" in the frame of the water: R^T z + R^T Dv/Dt / g (Froude-Krylov force).
    # Height of a point x above the local surface: z_m + x climb.
    u, v, w, p, q, r = nu_r
    up = rows[2]
    relative = (u, v, w, p, q - water_omega[1], r - water_omega[2])
    g = model.hydrostatics.gravity_mps2
    effective_up = (
        up[0] + acceleration[0] / g,
        up[1] + acceleration[1] / g,
        up[2] + acceleration[2] / g,
    )
    z_m, climb = state[2] - water.surface_m, up[0] - water.surface_slope
    immersed = restoring.immersion(z_m + climb * model.duct.x_m, model.duct.radius_m)
    total = coriolis(nu_r, model.inertia)
    total = _sum(
        total,
        restoring.wrench(
            z_m, climb, effective_up, water.density_ratio, model.hydrostatics, model.stations
        ),
    )
    total = _sum(
        total, hydrodynamics.crossflow_drag(v, w, relative[4], relative[5], model.stations)
    )
    total = _sum(
        total, hydrodynamics.lift_and_drag(u, v, w, p, relative[4], relative[5], model.hull)
    )
    total = _sum(total, tail(relative, axis, rudder_rad, elevator_rad, shaft_rps, immersed, model))
    total = _sum(total, boundary.wrench(state, rows, nu_r, water, model.hydrostatics, model.walls))
    return _sum(
        total,
        hydrodynamics.duct_interaction(immersed * u * abs(u), rudder_rad, elevator_rad, model.hull),
    )


@kernel
def _kinematics(state: Vector, rows: tuple[Vector3, Vector3, Vector3], out: Vector) -> None:
    """Write the rates of position, R v, and quaternion, 1/2 q (0, omega), into ``out[0:7]``."""
    # Fossen 2021, sec. 2.2; (e0, e1, e2, e3) is the quaternion, scalar first.
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
    """Write the state derivative for a given duct axis into ``out``; see ``derivative``."""
    # (c_x, c_y, c_z) = R^T c: velocity of the water over ground, body axes, m/s.
    # nu_r = nu - (R^T c, 0); f and disturbance: wrench (X, Y, Z, K, M, N), N and N m.
    # nu_r' = (M_RB + M_A)^-1 (f + disturbance).
    rows = rotation(state)
    c_x, c_y, c_z = _in_body(rows, water.velocity_mps)
    acceleration = _in_body(rows, water.acceleration_mps2)
    p, q, r = state[10], state[11], state[12]
    nu_r = (state[7] - c_x, state[8] - c_y, state[9] - c_z, p, q, r)
    water_omega = _line_rotation_rate(_in_body(rows, water.slope_per_s))
    f = _forces(
        state,
        rows,
        nu_r,
        water,
        acceleration,
        water_omega,
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
    # nu' = nu_r' + d(R^T c)/dt = nu_r' + R^T c' - omega x R^T c (Fossen 2021, sec. 10.3). c' is the
    # acceleration Dv/Dt of the water itself, not the rate of change seen from the moving body
    # (Auton, Hunt and Prud'homme 1988, J. Fluid Mech. 197).
    out[7] += acceleration[0] - (q * c_z - r * c_y)
    out[8] += acceleration[1] - (r * c_x - p * c_z)
    out[9] += acceleration[2] - (p * c_y - q * c_x)
    # A hull of neutral density turns with the line of water in which it lies.
    water_omega_rate = _line_rotation_rate(_in_body(rows, water.slope_rate_per_s2))
    out[11] += water_omega_rate[1]
    out[12] += water_omega_rate[2]


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
    """Write d(state)/dt into ``out``.

    Parameters
    ----------
    state : ndarray, shape (13,)
        Position NWU, quaternion, velocity over ground in FLU; see the module docstring.
    rudder_rad : float
        Rudder angle of the duct or fins, rad; positive turns the nose to starboard.
    elevator_rad : float
        Elevator angle of the duct or fins, rad; positive turns the nose up.
    propeller_rps : float
        Shaft speed, rev/s; negative is astern.
    disturbance : ndarray, shape (6,)
        Additional wrench (X, Y, Z, K, M, N) on the body in FLU axes about the origin, N and N m.
    water : Water
        Velocity, acceleration, surface and boundaries of the water at the hull, NWU.
    model : VehicleModel
        The vehicle, from ``build_model.build``.
    out : ndarray, shape (13,)
        Receives the rates, in the order of ``state``.

    Notes
    -----
    (M_RB + M_A) nu_r' = -C(nu_r) nu_r + hydrostatics + crossflow + hull + tail + boundary +
    disturbance (Fossen 2021, sec. 10.3; the paper, "Overall Vehicle Modeling"). The equation holds
    in a frame that moves with the water at the hull; effective gravity there is g - Dv/Dt.
    """
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
    """Advance ``state`` in place by one Runge-Kutta step of order four with constant inputs.

    Parameters
    ----------
    state : ndarray, shape (13,)
        Position NWU, quaternion, velocity over ground in FLU; overwritten with the new state.
    rudder_rad : float
        Rudder angle of the duct or fins, rad; positive turns the nose to starboard.
    elevator_rad : float
        Elevator angle of the duct or fins, rad; positive turns the nose up.
    propeller_rps : float
        Shaft speed, rev/s; negative is astern.
    disturbance : ndarray, shape (6,)
        Additional wrench (X, Y, Z, K, M, N) on the body in FLU axes about the origin, N and N m.
    water : Water
        Velocity, acceleration, surface and boundaries of the water at the hull, NWU.
    dt : float
        Step, s.
    model : VehicleModel
        The vehicle, from ``build_model.build``.
    work : ndarray, shape (5, 13)
        Scratch space from ``work_array``.

    Notes
    -----
    Classical scheme: x(t + dt) = x + dt/6 (k1 + 2 k2 + 2 k3 + k4). The quaternion is normalised at
    the end of the step.
    """
    axis = duct.ring_axis(model.duct.vectored * rudder_rad, model.duct.vectored * elevator_rad)
    k1, k2, k3, k4, midpoint = work[0], work[1], work[2], work[3], work[4]
    _slope(state, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k1)
    for i in range(STATE_SIZE):
        midpoint[i] = state[i] + 0.5 * dt * k1[i]
    _slope(midpoint, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k2)
    for i in range(STATE_SIZE):
        midpoint[i] = state[i] + 0.5 * dt * k2[i]
    _slope(midpoint, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k3)
    for i in range(STATE_SIZE):
        midpoint[i] = state[i] + dt * k3[i]
    _slope(midpoint, axis, rudder_rad, elevator_rad, propeller_rps, disturbance, water, model, k4)
    for i in range(STATE_SIZE):
        state[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    norm = sqrt(
        state[3] * state[3] + state[4] * state[4] + state[5] * state[5] + state[6] * state[6]
    )
    for i in range(3, 7):
        state[i] /= norm


@entry_point
def specific_force(state: Vector, rate: Vector, model: VehicleModel) -> Vector3:
    """Return the reading of an ideal accelerometer at the origin.

    Parameters
    ----------
    state : ndarray, shape (13,)
        Position NWU, quaternion, velocity over ground in FLU.
    rate : ndarray, shape (13,)
        d(state)/dt from ``derivative``.
    model : VehicleModel
        Only its gravity is used.

    Returns
    -------
    tuple of 3 floats
        Specific force v' + omega x v - g in FLU axes, m/s2; (0, 0, +9.81) in a level vehicle at
        rest.
    """
    _, _, up = rotation(state)
    u, v, w, p, q, r = state[7], state[8], state[9], state[10], state[11], state[12]
    g = model.hydrostatics.gravity_mps2
    return (
        rate[7] + q * w - r * v + g * up[0],
        rate[8] + r * u - p * w + g * up[1],
        rate[9] + p * v - q * u + g * up[2],
    )
