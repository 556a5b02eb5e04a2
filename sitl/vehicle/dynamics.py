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

from mavlink_io.jit import kernel
from sitl.vehicle import boundary, forces, runge_kutta
from sitl.vehicle.forces import HullFlow, TailInputs
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.runge_kutta import STAGES
from sitl.vehicle.vectors import Vector, Vector3
from sitl.vehicle.water import Water

STATE_SIZE = 13
POSITION = slice(0, 3)
QUATERNION = slice(3, 7)
NU = slice(7, 13)


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


@kernel
def work_array() -> Vector:
    """Return scratch space for ``rk4_step``, shape (5, 13): four slopes and a state."""
    return np.empty((STAGES + 1, STATE_SIZE))


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
def _kinematics(state: Vector, rows: tuple[Vector3, Vector3, Vector3], out: Vector) -> None:
    """Write the rates of position, R v, and quaternion, 1/2 q (0, omega), into ``out[0:7]``."""
    # p' = R v,   e' = 1/2 e (0, omega)   (Fossen 2021, sec. 2.2), with p position NWU (m), v
    # velocity over ground (m/s) and omega angular velocity (rad/s) in FLU, e = (e0, e1, e2, e3)
    # quaternion, scalar first, body to NWU.
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
    tail: TailInputs,
    disturbance: Vector,
    water: Water,
    model: VehicleModel,
    out: Vector,
) -> None:
    """Write the state derivative for given inputs of the tail into ``out``; see ``derivative``."""
    # c = R^T c_nwu and a = R^T Dv/Dt: velocity over ground (m/s) and acceleration (m/s2) of the
    # water, body axes. w_q, w_r: angular velocity of the line of water along the hull, rad/s.
    #     nu_r = nu - (c, 0),   nu_flow = nu_r - (0, 0, 0, 0, w_q, w_r),
    #     nu_r' = (M_RB + M_A)^-1 (f + disturbance),   f and disturbance in N and N m.
    # Height of a point x above the local surface: z_m + x climb.
    # Effective "up" in the frame of the water: R^T z + a / g (Froude-Krylov force).
    rows = rotation(state)
    c_x, c_y, c_z = _in_body(rows, water.velocity_mps)
    a_x, a_y, a_z = _in_body(rows, water.acceleration_mps2)
    _, w_q, w_r = _line_rotation_rate(_in_body(rows, water.slope_per_s))
    p, q, r = state[10], state[11], state[12]
    u, v, w = state[7] - c_x, state[8] - c_y, state[9] - c_z
    nu_r = (u, v, w, p, q, r)
    up, g = rows[2], model.hydrostatics.gravity_mps2
    flow = HullFlow(
        nu=nu_r,
        nu_flow=(u, v, w, p, q - w_q, r - w_r),
        up=(up[0] + a_x / g, up[1] + a_y / g, up[2] + a_z / g),
        height_m=state[2] - water.surface_m,
        climb=up[0] - water.surface_slope,
        density_ratio=water.density_ratio,
        boundary=boundary.wrench(state, rows, nu_r, water, model.hydrostatics, model.walls),
    )
    f = forces.total(flow, tail, model)
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
    out[7] += a_x - (q * c_z - r * c_y)
    out[8] += a_y - (r * c_x - p * c_z)
    out[9] += a_z - (p * c_y - q * c_x)
    # A hull of neutral density turns with the line of water in which it lies.
    _, w_q_rate, w_r_rate = _line_rotation_rate(_in_body(rows, water.slope_rate_per_s2))
    out[11] += w_q_rate
    out[12] += w_r_rate


@kernel
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
    tail = forces.tail_inputs(rudder_rad, elevator_rad, propeller_rps, model)
    _slope(state, tail, disturbance, water, model, out)


@kernel
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
    Classical scheme (``runge_kutta``). The quaternion is normalised at the end of the step.
    """
    tail = forces.tail_inputs(rudder_rad, elevator_rad, propeller_rps, model)
    stage_state = work[STAGES]
    for stage in range(STAGES):
        runge_kutta.stage_state(stage, state, work, dt, stage_state)
        _slope(stage_state, tail, disturbance, water, model, work[stage])
    runge_kutta.combine(state, work, dt, state)
    norm = sqrt(
        state[3] * state[3] + state[4] * state[4] + state[5] * state[5] + state[6] * state[6]
    )
    for i in range(3, 7):
        state[i] /= norm


@kernel
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
    # f = v' + omega x v - R^T g, with v' (m/s2) and omega (rad/s) in FLU and g = (0, 0, -g) in NWU
    # (Titterton and Weston 2004, ch. 3).
    _, _, up = rotation(state)
    u, v, w, p, q, r = state[7], state[8], state[9], state[10], state[11], state[12]
    g = model.hydrostatics.gravity_mps2
    return (
        rate[7] + q * w - r * v + g * up[0],
        rate[8] + r * u - p * w + g * up[1],
        rate[9] + p * v - q * u + g * up[2],
    )
