"""Linear yaw and pitch planes from numeric derivatives of the nonlinear equations of motion.

Symbols, in the paper's FLU axes: nu = (u, v, w, p, q, r), U forward speed, dR and dE rudder and
elevator angle. Linear planes (paper, Table 1; x_CM and z_CM position of the centre of mass):

    (m - Y_vdot) v'    = Y_v v + (Y_r - m U) r + Y_dr dR
    (I_zz - N_rdot) r' = N_v v + (N_r - m x_CM U) r + N_dr dR,       psi' = r
    (m - Z_wdot) w'    = Z_w w + (Z_q + m U) q + Z_de dE
    (I_yy - M_qdot) q' = M_w w + (M_q - m x_CM U) q + m g z_CM theta + M_de dE
    theta' = q,  depth' = U theta - w

Only ``dynamics.derivative`` is used, not the formulas of ``build_model``: central differences in
state and duct angles, and the response to unit disturbances for the mass matrix. So the result is
an independent check of ``build_model``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sitl.vehicle import dynamics
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.vectors import Vector
from sitl.vehicle.water import STILL

STEP = 1e-8
"""Half width of the central differences in SI units.

Crossflow drag and quadratic duct lift cause an error proportional to it."""
DEPTH_M = 100.0
"""Depth of the operating point: surface and floor have no effect."""

SURGE, SWAY, HEAVE, _, PITCH, YAW = range(6)
"""Indices into nu."""
ABOUT_Y = 1
"""Index of the rotation about y (pitch) in a rotation vector."""


class LinearisedPlane(NamedTuple):
    """Linear plane M x' = F x + G delta, and the same solved for x' = A x + B delta."""

    M: Vector
    """Mass matrix, (n, n); identity for kinematic states."""
    F: Vector
    """Force per state, (n, n)."""
    G: Vector
    """Force per surface angle, (n, 1)."""
    A: Vector
    """M^-1 F, (n, n)."""
    B: Vector
    """M^-1 G, (n, 1)."""


class LinearPlanes(NamedTuple):
    """Yaw and pitch plane in the paper's axes, and the coefficients of Table 1; SI and radians."""

    yaw: LinearisedPlane
    """States (v, r, psi), input rudder."""
    pitch: LinearisedPlane
    """States (w, q, theta, depth), input elevator; theta is positive nose down."""
    coefficients: dict[str, float]
    """Table 1's column, by the key of the vehicle file's ``linear`` table."""


def linearise(
    model: VehicleModel, u_mps: float = 1.3, thrust_fraction: float | None = None
) -> LinearPlanes:
    """Linearise straight and level motion in deep, still water.

    The operating point is the paper's: pitch and duct angles are zero, and the net buoyancy of a
    few newtons is not balanced.

    Parameters
    ----------
    model : VehicleModel
        The vehicle.
    u_mps : float
        Forward speed through the water, m/s.
    thrust_fraction : float, optional
        Thrust command, -1 to 1. Without it, thrust balances the axial drag.

    Returns
    -------
    LinearPlanes
        Yaw and pitch plane in the paper's FLU axes, and Table 1's coefficients.

    Notes
    -----
    Jacobians by central differences of ``dynamics.derivative``; M is the inverse of the
    accelerations to unit wrenches, F = M d(nu')/d(nu) and G = M d(nu')/d(delta).
    """
    shaft_rps = (
        _balanced_rps(model, u_mps)
        if thrust_fraction is None
        else thrust_fraction * model.propeller.full_rps
    )
    acceleration = _acceleration(model, u_mps, shaft_rps)
    M = _mass_matrix(acceleration)
    d_nu_rate_d_nu = np.column_stack([_slope_of(acceleration, nu=i) for i in range(6)])
    d_nu_rate_d_angle = np.column_stack([_slope_of(acceleration, rotation=i) for i in range(3)])
    d_nu_rate_d_duct = np.column_stack([_slope_of(acceleration, duct=i) for i in range(2)])
    F, F_angle, G = M @ d_nu_rate_d_nu, M @ d_nu_rate_d_angle, M @ d_nu_rate_d_duct
    return LinearPlanes(
        yaw=_yaw(M, F, G),
        pitch=_pitch(M, F, F_angle, G, u_mps),
        coefficients=_coefficients(model, M, F, F_angle, G, u_mps),
    )


def _balanced_rps(model: VehicleModel, u_mps: float) -> float:
    """Return the shaft speed, rev/s, that gives no surge acceleration, by bisection."""
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
    """Return nu' as a function of deviations in nu, rotation, duct angles, and of a wrench.

    Their sizes are 6, 3, 2 and 6.
    """

    def nu_rate(nu: Vector, rotation: Vector, duct: Vector, disturbance: Vector) -> Vector:
        """Return the rates of the body velocities (m/s2, rad/s2) for small changes from trim."""
        state, rate = dynamics.state_at_rest(-DEPTH_M), np.empty(dynamics.STATE_SIZE)
        state[4:7] = rotation / 2
        state[dynamics.NU] = nu
        state[7] += u_mps
        dynamics.derivative(state, duct[0], duct[1], shaft_rps, disturbance, STILL, model, rate)
        return rate[dynamics.NU]

    return nu_rate


def _slope_of(
    acceleration: Acceleration,
    nu: int | None = None,
    rotation: int | None = None,
    duct: int | None = None,
) -> Vector:
    """Return the derivative of nu' with respect to one component, shape (6,)."""
    d_nu, d_rotation, d_duct = (
        _unit(size, i) * STEP for size, i in ((6, nu), (3, rotation), (2, duct))
    )
    ahead = acceleration(d_nu, d_rotation, d_duct, np.zeros(6))
    behind = acceleration(-d_nu, -d_rotation, -d_duct, np.zeros(6))
    return (ahead - behind) / (2 * STEP)


def _unit(size: int, index: int | None) -> Vector:
    """Return unit vector ``index`` of length ``size``; zeros for None."""
    unit = np.zeros(size)
    if index is not None:
        unit[index] = 1.0
    return unit


def _mass_matrix(acceleration: Acceleration) -> Vector:
    """Return M, shape (6, 6): the inverse of the accelerations to unit wrenches."""
    no_deviation = np.zeros(6), np.zeros(3), np.zeros(2)
    undisturbed = acceleration(*no_deviation, np.zeros(6))
    return np.linalg.inv(
        np.column_stack([acceleration(*no_deviation, _unit(6, i)) - undisturbed for i in range(6)])
    )


def _plane(M: Vector, F: Vector, G: Vector) -> LinearisedPlane:
    """Return the plane with A = M^-1 F and B = M^-1 G."""
    return LinearisedPlane(
        M=M,
        F=F,
        G=G,
        A=np.asarray(np.linalg.solve(M, F), float),
        B=np.asarray(np.linalg.solve(M, G), float),
    )


def _yaw(M: Vector, F: Vector, G: Vector) -> LinearisedPlane:
    """Return the yaw plane: states (v, r, psi), input rudder."""
    mass, force, input_force = np.eye(3), np.zeros((3, 3)), np.zeros((3, 1))
    block = np.ix_([SWAY, YAW], [SWAY, YAW])
    mass[:2, :2] = M[block]
    force[:2, :2] = F[block]
    force[2, 1] = 1.0
    input_force[:2, 0] = G[[SWAY, YAW], 0]
    return _plane(mass, force, input_force)


def _pitch(M: Vector, F: Vector, F_angle: Vector, G: Vector, u_mps: float) -> LinearisedPlane:
    """Return the pitch plane: states (w, q, theta, depth); theta' = q, depth' = U theta - w."""
    mass, force, input_force = np.eye(4), np.zeros((4, 4)), np.zeros((4, 1))
    block = np.ix_([HEAVE, PITCH], [HEAVE, PITCH])
    mass[:2, :2] = M[block]
    force[:2, :2] = F[block]
    force[:2, 2] = F_angle[[HEAVE, PITCH], ABOUT_Y]
    force[2, 1] = 1.0
    force[3, :3] = -1.0, 0.0, u_mps
    input_force[:2, 0] = G[[HEAVE, PITCH], 1]
    return _plane(mass, force, input_force)


def _coefficients(
    model: VehicleModel, M: Vector, F: Vector, F_angle: Vector, G: Vector, u_mps: float
) -> dict[str, float]:
    """Return Table 1's column by key of the vehicle file.

    The motion gives only the difference I_zz - N_rdot; I_zz is taken from the model's rigid body.
    """
    # The equations of the module docstring, solved for the coefficients of Table 1: F and G are the
    # derivatives of the force -C nu + tau by velocity and by surface angle, M the mass matrix.
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
