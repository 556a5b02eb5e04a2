"""Linear yaw and pitch planes, differentiated from the nonlinear equations of motion.

Only ``dynamics.derivative`` is used, never the formulas of the calibration: central differences in
state and duct angles, and the response to unit disturbances for the mass matrix."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sitl.vehicle import dynamics
from sitl.vehicle.jit import Vector
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.water import STILL

STEP = 1e-8
"""Half width of the differences: crossflow drag and the quadratic duct lift leave an error
proportional to it."""
DEPTH_M = 100.0

SURGE, SWAY, HEAVE, _, PITCH, YAW = range(6)
ABOUT_Y = 1


class Plane(NamedTuple):
    """M x' = F x + G delta, with x' = A x + B delta solved from it."""

    M: Vector
    F: Vector
    G: Vector
    A: Vector
    B: Vector


class LinearPlanes(NamedTuple):
    """Planes in the paper's axes and Table 1's coefficients.

    ``yaw``: states (v, r, psi), input rudder. ``pitch``: states (w, q, theta, depth), input
    elevator; theta positive nose down, depth positive down. SI units and radians."""

    yaw: Plane
    pitch: Plane
    coefficients: dict[str, float]
    """By the names of the vehicle file's ``linear`` table."""


def linearise(
    model: VehicleModel, u_mps: float = 1.3, thrust_fraction: float | None = None
) -> LinearPlanes:
    """Linearise straight and level flight at ``u_mps``, deep, still water; ``thrust_fraction`` None
    balances drag.

    The operating point is the paper's: the few newtons of net buoyancy are left to the trim.
    """
    shaft_rps = (
        _balanced_rps(model, u_mps)
        if thrust_fraction is None
        else thrust_fraction * model.propeller.full_rps
    )
    acceleration = _acceleration(model, u_mps, shaft_rps)
    M = _mass_matrix(acceleration)
    by_nu = np.column_stack([_slope_of(acceleration, nu=i) for i in range(6)])
    by_angle = np.column_stack([_slope_of(acceleration, turn=i) for i in range(3)])
    by_duct = np.column_stack([_slope_of(acceleration, duct=i) for i in range(2)])
    F, F_angle, G = M @ by_nu, M @ by_angle, M @ by_duct
    return LinearPlanes(
        yaw=_yaw(M, F, G),
        pitch=_pitch(M, F, F_angle, G, u_mps),
        coefficients=_coefficients(model, M, F, F_angle, G, u_mps),
    )


def _balanced_rps(model: VehicleModel, u_mps: float) -> float:
    """Shaft speed whose thrust leaves no surge acceleration, by bisection on the full equations."""
    low, high = 0.0, 2 * model.propeller.full_rps * max(1.0, u_mps)
    for _ in range(80):
        middle = (low + high) / 2
        surge = _acceleration(model, u_mps, middle)(
            np.zeros(6), np.zeros(3), np.zeros(2), np.zeros(6)
        )[SURGE]
        low, high = (middle, high) if surge < 0 else (low, middle)
    return (low + high) / 2


Acceleration = Callable[[Vector, Vector, Vector, Vector], Vector]


def _acceleration(model: VehicleModel, u_mps: float, shaft_rps: float) -> Acceleration:
    """nu' as a function of small departures in nu (6), rotation (3), duct angles (2), and of a
    disturbance (6)."""

    def nu_rate(nu: Vector, turn: Vector, duct: Vector, disturbance: Vector) -> Vector:
        state, rate = dynamics.state_at_rest(-DEPTH_M), np.empty(dynamics.STATE_SIZE)
        state[4:7] = turn / 2
        state[dynamics.NU] = nu
        state[7] += u_mps
        dynamics.derivative(state, duct[0], duct[1], shaft_rps, disturbance, STILL, model, rate)
        return rate[dynamics.NU]

    return nu_rate


def _slope_of(
    acceleration: Acceleration,
    nu: int | None = None,
    turn: int | None = None,
    duct: int | None = None,
) -> Vector:
    """Derivative of nu' by one component, shape (6,)."""
    d_nu, d_turn, d_duct = (_unit(size, i) * STEP for size, i in ((6, nu), (3, turn), (2, duct)))
    ahead = acceleration(d_nu, d_turn, d_duct, np.zeros(6))
    behind = acceleration(-d_nu, -d_turn, -d_duct, np.zeros(6))
    return (ahead - behind) / (2 * STEP)


def _unit(size: int, index: int | None) -> Vector:
    unit = np.zeros(size)
    if index is not None:
        unit[index] = 1.0
    return unit


def _mass_matrix(acceleration: Acceleration) -> Vector:
    """What resists a disturbance: the inverse of the accelerations to unit wrenches."""
    none = np.zeros(6), np.zeros(3), np.zeros(2)
    start = acceleration(*none, np.zeros(6))
    return np.linalg.inv(
        np.column_stack([acceleration(*none, _unit(6, i)) - start for i in range(6)])
    )


def _plane(M: Vector, F: Vector, G: Vector) -> Plane:
    return Plane(
        M=M,
        F=F,
        G=G,
        A=np.asarray(np.linalg.solve(M, F), float),
        B=np.asarray(np.linalg.solve(M, G), float),
    )


def _yaw(M: Vector, F: Vector, G: Vector) -> Plane:
    """States (v, r, psi)."""
    mass, force, effect = np.eye(3), np.zeros((3, 3)), np.zeros((3, 1))
    pick = np.ix_([SWAY, YAW], [SWAY, YAW])
    mass[:2, :2] = M[pick]
    force[:2, :2] = F[pick]
    force[2, 1] = 1.0
    effect[:2, 0] = G[[SWAY, YAW], 0]
    return _plane(mass, force, effect)


def _pitch(M: Vector, F: Vector, F_angle: Vector, G: Vector, u_mps: float) -> Plane:
    """States (w, q, theta, depth); theta' = q, depth' = U theta - w."""
    mass, force, effect = np.eye(4), np.zeros((4, 4)), np.zeros((4, 1))
    pick = np.ix_([HEAVE, PITCH], [HEAVE, PITCH])
    mass[:2, :2] = M[pick]
    force[:2, :2] = F[pick]
    force[:2, 2] = F_angle[[HEAVE, PITCH], ABOUT_Y]
    force[2, 1] = 1.0
    force[3, :3] = -1.0, 0.0, u_mps
    effect[:2, 0] = G[[HEAVE, PITCH], 1]
    return _plane(mass, force, effect)


def _coefficients(
    model: VehicleModel, M: Vector, F: Vector, F_angle: Vector, G: Vector, u_mps: float
) -> dict[str, float]:
    """Table 1's column. Motion does not show how I_zz - N_rdot splits; I is taken from the model's
    rigid body."""
    body, m, h = model.inertia.M_RB, model.inertia.mass_kg, model.hydrostatics
    m_x_U = m * h.x_cm_m * u_mps
    table = {
        "Y_v_kgps": F[SWAY, SWAY],
        "N_v_kgmps": F[YAW, SWAY],
        "Y_r_kgmps": F[SWAY, YAW] + m * u_mps,
        "N_r_kgm2ps": F[YAW, YAW] + m_x_U,
        "Y_dr_nprad": G[SWAY, 0],
        "N_dr_nmprad": G[YAW, 0],
        "Y_vdot_kg": m - M[SWAY, SWAY],
        "I_zz_kgm2": body[YAW, YAW],
        "N_rdot_kgm2": body[YAW, YAW] - M[YAW, YAW],
        "Z_w_kgps": F[HEAVE, HEAVE],
        "M_w_kgmps": F[PITCH, HEAVE],
        "Z_q_kgmps": F[HEAVE, PITCH] - m * u_mps,
        "M_q_kgm2ps": F[PITCH, PITCH] + m_x_U,
        "Z_de_nprad": G[HEAVE, 1],
        "M_de_nmprad": G[PITCH, 1],
        "Z_wdot_kg": m - M[HEAVE, HEAVE],
        "I_yy_kgm2": body[PITCH, PITCH],
        "M_qdot_kgm2": body[PITCH, PITCH] - M[PITCH, PITCH],
        "z_CM_m": F_angle[PITCH, ABOUT_Y] / (m * h.gravity_mps2),
    }
    return {name: float(value) for name, value in table.items()}
