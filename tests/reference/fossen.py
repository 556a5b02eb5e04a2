"""Independent implementation of the vehicle: Fossen's equations in matrix form.

Source: T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion Control", 2nd ed., 2021, in
his axes and structure: NED and FRD, Euler angles, separate terms for the rigid body over ground and
for added mass through the water, Coriolis and damping as matrices, numpy. It uses the numbers of
the simulator's vehicle model but calls no kernel.

    M_RB nu' + C_RB(nu) nu + M_A nu_r' + C_A(nu_r) nu_r + D(nu_r) nu_r + g(eta) = tau
    (ch. 6 and 10)

Deep water only: no surface, floor or waves.
"""

from __future__ import annotations

from math import cos, sin, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.model import Fins, Polar, VehicleModel

Array = NDArray[np.float64]

TURN = np.diag([1.0, -1.0, -1.0])
"""Rotation between FLU and FRD; it is its own inverse."""
FLIP = np.diag([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""Rotation between FLU and FRD for velocities and wrenches of six components."""


class Inputs(NamedTuple):
    """Surface angles and shaft speed."""

    rudder_rad: float = 0.0
    elevator_rad: float = 0.0
    shaft_rps: float = 0.0


class Craft(NamedTuple):
    """A vehicle in Fossen's symbols, FRD about the origin."""

    m: float
    r_g: Array
    I_b: Array
    M_RB: Array
    M_A: Array
    W: float
    B: float
    r_b: Array
    model: VehicleModel
    """Geometry of strips, ring and fins."""


def craft(model: VehicleModel) -> Craft:
    """Convert the numbers of the simulator's model."""
    h, m = model.hydrostatics, model.inertia.mass_kg
    M_RB = FLIP @ model.inertia.M_RB @ FLIP
    return Craft(
        m=m,
        r_g=np.array([M_RB[1, 5], M_RB[2, 3], M_RB[0, 4]]) / m,
        I_b=M_RB[3:, 3:],
        M_RB=M_RB,
        M_A=FLIP @ model.inertia.M_A @ FLIP,
        W=h.weight_n,
        B=h.buoyancy_n,
        r_b=TURN @ [h.x_cb_m, 0.0, h.z_cb_m],
        model=model,
    )


def S(a: Array) -> Array:
    """Cross-product matrix (ch. 2)."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def R(Theta: Array) -> Array:
    """Body to NED by Euler angles, zyx (ch. 2)."""
    phi, theta, psi = Theta
    Rx = np.array([[1, 0, 0], [0, cos(phi), -sin(phi)], [0, sin(phi), cos(phi)]])
    Ry = np.array([[cos(theta), 0, sin(theta)], [0, 1, 0], [-sin(theta), 0, cos(theta)]])
    Rz = np.array([[cos(psi), -sin(psi), 0], [sin(psi), cos(psi), 0], [0, 0, 1]])
    return np.asarray(Rz @ Ry @ Rx)


def T(Theta: Array) -> Array:
    """Body rates to rates of the Euler angles (ch. 2)."""
    phi, theta, _ = Theta
    return np.array(
        [
            [1, sin(phi) * tan(theta), cos(phi) * tan(theta)],
            [0, cos(phi), -sin(phi)],
            [0, sin(phi) / cos(theta), cos(phi) / cos(theta)],
        ]
    )


def C_RB(nu: Array, ship: Craft) -> Array:
    """Rigid-body Coriolis matrix (ch. 3, Lagrangian parametrisation)."""
    nu1, nu2 = nu[:3], nu[3:]
    corner = -ship.m * S(nu1) - ship.m * S(S(nu2) @ ship.r_g)
    return np.block(
        [[np.zeros((3, 3)), corner], [corner, ship.m * S(S(nu1) @ ship.r_g) - S(ship.I_b @ nu2)]]
    )


def C_A(nu_r: Array, ship: Craft) -> Array:
    """Added-mass Coriolis matrix (ch. 6), of which the Munk moment is a part."""
    linear, angular = np.split(ship.M_A @ nu_r, 2)
    return np.block([[np.zeros((3, 3)), -S(linear)], [-S(linear), -S(angular)]])


def D(nu_r: Array, ship: Craft) -> Array:
    """Damping of the hull beside the cross flow (ch. 6): lift in proportion to speed, quadratic
    drag, roll.
    """
    u, p = nu_r[0], nu_r[3]
    h, forward = ship.model.hull, abs(u)
    in_flu = -np.array(
        [
            [-h.X_uu_kgpm * forward, 0, 0, 0, 0, 0],
            [0, h.Y_uv_kgpm * forward, 0, 0, 0, h.Y_ur_kg * u],
            [0, 0, h.Z_uw_kgpm * forward, 0, h.Z_uq_kg * u, 0],
            [0, 0, 0, -h.K_p_nms - h.K_pp_nms2 * abs(p), 0, 0],
            [0, 0, h.M_uw_kg * u, 0, h.M_uq_kgm * forward, 0],
            [0, h.N_uv_kg * u, 0, 0, 0, h.N_ur_kgm * forward],
        ]
    )
    return np.asarray(FLIP @ in_flu @ FLIP)


def crossflow(nu_r: Array, ship: Craft) -> Array:
    """Strips in the cross flow (ch. 6), the speeds of the two planes joined."""
    x, k = ship.model.stations.x_m, ship.model.stations.drag_kgpm
    across = np.array([nu_r[1] + x * nu_r[5], nu_r[2] - x * nu_r[4]])
    Y, Z = force = -k * np.hypot(*across) * across
    return np.array([0.0, *force.sum(axis=1), 0.0, -(x * Z).sum(), (x * Y).sum()])


def g(Theta: Array, ship: Craft) -> Array:
    """Restoring forces and moments of a submerged vehicle (ch. 4)."""
    phi, theta, _ = Theta
    W, B = ship.W, ship.B
    x, y, z = W * ship.r_g - B * ship.r_b
    return np.array(
        [
            (W - B) * sin(theta),
            -(W - B) * cos(theta) * sin(phi),
            -(W - B) * cos(theta) * cos(phi),
            -y * cos(theta) * cos(phi) + z * cos(theta) * sin(phi),
            z * sin(theta) + x * cos(theta) * cos(phi),
            -x * cos(theta) * sin(phi) - y * sin(theta),
        ]
    )


def polar_coefficients(alpha: float, polar: Polar) -> tuple[float, float]:
    """(C_L, C_D) of a wing at incidence ``alpha``, 0 to pi/2."""
    C_L = polar.lift_slope_per_rad * alpha + polar.lift_quadratic_per_rad2 * alpha**2
    attached = np.array([C_L, polar.drag_zero_lift + polar.induced_drag * C_L**2])
    C_n = polar.separated_normal * sin(alpha)
    separated = np.array([C_n * cos(alpha), polar.drag_zero_lift + C_n * sin(alpha)])
    share = np.clip((alpha - polar.stall_rad) / (polar.separated_rad - polar.stall_rad), 0.0, 1.0)
    C_L, C_D = attached + share**2 * (3 - 2 * share) * (separated - attached)
    return float(C_L), float(C_D)


def wing(flow: Array, chord: Array, pressure_area: float, polar: Polar) -> Array:
    """Lift and drag of a wing moving at ``flow`` with its chord along ``chord``: the paper's t1,
    t2, t3 frame.
    """
    V = float(np.linalg.norm(flow))
    if V == 0.0:
        return np.zeros(3)
    facing = chord if flow @ chord >= 0 else -chord
    alpha = float(np.arctan2(np.linalg.norm(S(flow) @ facing), flow @ facing))
    t1, t2 = flow / V, S(flow) @ facing
    C_L, C_D = polar_coefficients(alpha, polar)
    side = np.linalg.norm(t2)
    t3 = S(t1) @ t2 / side if side > 0.0 else np.zeros(3)
    return np.asarray(-pressure_area * V**2 * (C_D * t1 + C_L * t3))


def at_point(force: Array, r: Array) -> Array:
    """Wrench about the origin of a force at ``r``: the transpose of H(r) (ch. 3)."""
    return np.concatenate([force, S(r) @ force])


def tail(nu_r: Array, inputs: Inputs, ship: Craft) -> Array:
    """Ring wing, its thrust and the fins."""
    duct, propeller, hull = ship.model.duct, ship.model.propeller, ship.model.hull
    rudder, elevator, n = inputs
    r = np.array([duct.x_m, 0.0, 0.0])
    flow = nu_r[:3] + S(nu_r[3:]) @ r
    # FRD: positive rudder throws the tail to port, so the ring's forward axis leans to port;
    # elevator leans it down.
    turned = R(np.array([0.0, 0.0, -duct.vectored * rudder])) @ [1.0, 0.0, 0.0]
    axis = R(np.array([0.0, -duct.vectored * elevator, 0.0])) @ turned
    thrust = propeller.thrust_nn_kgm * n * abs(n) - propeller.thrust_nv_kg * abs(n) * (flow @ axis)
    total = at_point(wing(flow, axis, duct.half_rho_area_kgpm, duct.polar) + thrust * axis, r)
    pressure = nu_r[0] * abs(nu_r[0])
    interaction = [
        0,
        hull.Y_uudr_kgpm * rudder,
        hull.Z_uude_kgpm * elevator,
        0,
        hull.M_uude_kg * elevator,
        hull.N_uudr_kg * rudder,
    ]
    by_hull: Array = FLIP @ np.multiply(pressure, interaction)
    return total + by_hull + fins(nu_r, inputs, ship.model.fins)


def fins(nu_r: Array, inputs: Inputs, tail: Fins) -> Array:
    """Return the wrench of the fins: wings in the plane of chord and normal."""
    total = np.zeros(6)
    for y, z, by_rudder, by_elevator in zip(
        tail.span_y, tail.span_z, tail.rudder, tail.elevator, strict=True
    ):
        span, lead = TURN @ [0.0, y, z], TURN @ [0.0, -z, y]
        r = TURN @ [tail.x_m, tail.out_m * y, tail.out_m * z]
        turned = by_rudder * inputs.rudder_rad + by_elevator * inputs.elevator_rad
        turn = float(np.clip(turned, -tail.travel_rad, tail.travel_rad))
        chord = np.array([cos(turn), 0.0, 0.0]) + sin(turn) * lead
        flow = nu_r[:3] + S(nu_r[3:]) @ r
        total += at_point(
            wing(flow - (flow @ span) * span, chord, tail.half_rho_area_kgpm, tail.polar), r
        )
    return total


def rates(eta_nu: Array, inputs: Inputs, ship: Craft, current_ned: Array) -> Array:
    """d(eta, nu)/dt, shape (12,), in a steady uniform current."""
    Theta, nu = eta_nu[3:6], eta_nu[6:]
    J = R(Theta)
    v_c = J.T @ current_ned
    nu_r = nu - np.concatenate([v_c, np.zeros(3)])
    v_c_rate = np.concatenate([-S(nu[3:]) @ v_c, np.zeros(3)])
    tau = tail(nu_r, inputs, ship) + crossflow(nu_r, ship)
    force = (
        tau
        - C_RB(nu, ship) @ nu
        - C_A(nu_r, ship) @ nu_r
        - D(nu_r, ship) @ nu_r
        - g(Theta, ship)
        + ship.M_A @ v_c_rate
    )
    return np.concatenate(
        [J @ nu[:3], T(Theta) @ nu[3:], np.linalg.solve(ship.M_RB + ship.M_A, force)]
    )


def from_state(state: Array) -> Array:
    """(eta, nu) of a simulator's state: NWU and quaternion to NED and Euler angles."""
    w, x, y, z = state[3], state[4], -state[5], -state[6]
    phi = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    theta = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    psi = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.concatenate([TURN @ state[:3], [phi, theta, psi], FLIP @ state[7:13]])
