"""Garbled, inconsistent and wrong places of the paper, each with evidence that is computed here.

A place is settled by numbers: what the print gives, what the proposed reading gives, and what the
paper's own tables or statements require. `confirmed` states whether the numbers support the
reading. Axes and symbols are the paper's (x forward, y port, z up).
"""

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import duct
from sitl.vehicle.slender_body import Derivation
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Lag
from sysid.models import linear_planes
from sysid.reproduction import paper_poles
from sysid.reproduction.paper_poles import SinglePoleCondition, TransferReading
from sysid.reproduction.paper_poles.search import LAGS
from sysid.reproduction.paper_tables import (
    ACCELERATION_PER_S2,
    CRUISE_SPEED_MPS,
    MASS_KG,
    TABLE_1_ADJUSTED,
    TABLE_1_INITIAL,
    TABLE_3_IMPROVED,
    TABLE_3_INITIAL,
    Table1Column,
)

Array = NDArray[np.float64]

DELAY_S = 0.3
"""Delay that the paper's text gives."""
RIGID_BODY_POINTS = 40
"""Number of point masses of the body with which the rigid-body equations are checked."""
EXACT = 1e-9
"""Largest relative difference of equations that agree."""
FIGURE_7_BIAS_RAD = math.radians(6.0)
"""Rudder bias of figure 7 (rad)."""
PRINTED_CUTOFF_RADPS = (1.5, 4.0)
"""Range of the measured cut-off frequency of the tailcone (rad/s)."""
INTERPOLATION_POINTS = {1.25: 3.4855, 4.3716: 5.1566}
"""Lift slope (1/rad) by aspect ratio, to which the ring wing's formula was fitted."""
DRAG_KGPM = 0.5 * 1025.0 * math.pi * 0.5334**2 / 4.0
"""1/2 rho A_f of the hull, kg/m."""
HALF_LENGTH_M = 1.7715
"""Half of the total length of 3.543 m (m)."""


class Discrepancy(NamedTuple):
    """One place of the paper."""

    place: str
    printed: str
    reading: str
    """Proposed reading, or the reason of the contradiction."""
    evidence: str
    """Computed numbers in words."""
    values: dict[str, float]
    """Computed numbers by name, with the unit in the name."""
    confirmed: bool
    """Whether the numbers support the reading."""


class Sources(NamedTuple):
    """Computed results that the evidence uses."""

    steps: Mapping[str, Derivation]
    """Steps of the first-principles derivation, by symbol."""
    readings: Sequence[TransferReading]
    alone: Sequence[SinglePoleCondition]


def all_discrepancies(sources: Sources) -> list[Discrepancy]:
    """Return every place with its evidence, in the order of the paper.

    Parameters
    ----------
    sources : Sources
        Derivation of Table 1 and search for the tailcone behind Table 4.

    Returns
    -------
    list of Discrepancy
        Places with computed evidence.
    """
    of_tables: tuple[Callable[[Sources], Discrepancy], ...] = (
        _drag_exponent,
        _drag,
        _ellipsoid,
        _moment_indices,
        _moment_sign,
        _munk,
        _lift_slope,
        _duct_lift,
    )
    after: tuple[Callable[[Sources], Discrepancy], ...] = (_side_force, _table_4)
    return [
        _euler_angles(),
        _forces(),
        _moments(),
        *(entry(sources) for entry in of_tables),
        _angle_of_attack(),
        _duct_frame(),
        _actuator(),
        _delay(),
        _rate_limits(),
        *_transfer_function(),
        _yaw_acceleration(),
        _measured_accelerations(),
        _lever_arms(),
        *(entry(sources) for entry in after),
        _integrator_limit(),
    ]


def _euler_angles() -> Discrepancy:
    """Check the order of the Euler angles: which angle's rate is the yaw rate."""
    # E' = J(E) omega with E = (phi, theta, psi) about x, y, z (Fossen 2021, eq. 2.28).
    pitch = 0.2
    psi_rate = math.cos(0.0) / math.cos(pitch)
    phi_rate = math.cos(0.0) * math.tan(pitch)
    return Discrepancy(
        place="Overall Vehicle Modeling: Euler angles; Linearized Model: phi / delta_r",
        printed="(psi, theta, phi) describe roll, pitch and yaw; transfer function phi/delta",
        reading="psi is yaw, theta pitch, phi roll; the transfer function is psi/delta",
        evidence=(
            f"at a pitch of {pitch:g} rad a yaw rate of 1 rad/s turns psi by {psi_rate:.3f} and phi"
            f" by {phi_rate:.3f} rad/s; the numerator holds N_dr, so the angle is yaw"
        ),
        values={"psi_rate_radps": psi_rate, "phi_rate_radps": phi_rate},
        confirmed=abs(psi_rate) > abs(phi_rate),
    )


class _RigidBody(NamedTuple):
    """Point masses, and the motion of the frame in which they are at rest."""

    mass: Array
    position: Array
    """(points, 3), m."""
    velocity: Array
    rate: Array
    acceleration: Array
    """Derivative of the velocity in the body frame, (3,)."""
    rate_change: Array


def _rigid_body() -> _RigidBody:
    """Return a body without symmetry in arbitrary motion."""
    rng = np.random.default_rng(14)
    return _RigidBody(
        mass=rng.uniform(0.5, 2.0, RIGID_BODY_POINTS),
        position=rng.normal(0.3, 1.0, (RIGID_BODY_POINTS, 3)),
        velocity=rng.normal(size=3),
        rate=rng.normal(size=3),
        acceleration=rng.normal(size=3),
        rate_change=rng.normal(size=3),
    )


def _point_forces(body: _RigidBody) -> Array:
    """Return the force on each point, m (v' + w x v + w' x r + w x (w x r)), (points, 3)."""
    turning = np.cross(body.rate_change, body.position) + np.cross(
        body.rate, np.cross(body.rate, body.position)
    )
    common = body.acceleration + np.cross(body.rate, body.velocity)
    return np.asarray(body.mass[:, None] * (common + turning))


def _forces() -> Discrepancy:
    """Check the rigid-body X, Y, Z as printed, against Newton's law for points."""
    body = _rigid_body()
    m = float(body.mass.sum())
    x, y, z = (body.mass @ body.position) / m
    (u, v, w), (p, q, r) = body.velocity, body.rate
    (du, dv, dw), (dp, dq, dr) = body.acceleration, body.rate_change
    printed = m * np.array(
        [
            du + q * w - r * v + dq * z - dr * y + (q * y + r * z) * p - (q * q + r * r) * x,
            dv + r * u - p * w + dr * x - dp * z + (r * z + p * x) * q - (r * r + p * p) * y,
            dw + p * v - q * u + dp * y - dq * x + (p * x + q * y) * r - (p * p + q * q) * z,
        ]
    )
    error = _relative_error(printed, _point_forces(body).sum(axis=0))
    return Discrepancy(
        place="Overall Vehicle Modeling: X, Y, Z",
        printed="three equations with cross terms in x_CM, y_CM, z_CM",
        reading="correct as printed",
        evidence=f"relative difference to Newton's law for {RIGID_BODY_POINTS} points: {error:.0e}",
        values={"relative_error": error},
        confirmed=error < EXACT,
    )


def _moments() -> Discrepancy:
    """Check the rigid-body K, M, N as printed, with both conventions of the products of inertia."""
    body = _rigid_body()
    exact = np.cross(body.position, _point_forces(body)).sum(axis=0)
    tensor, positive = (_relative_error(_printed_moments(body, sign), exact) for sign in (-1, 1))
    return Discrepancy(
        place="Overall Vehicle Modeling: K, M, N",
        printed="products of inertia without their sign convention",
        reading="correct if I_xy = -int x y dm (element of the tensor), wrong if positive",
        evidence=(
            f"relative difference to the moment of {RIGID_BODY_POINTS} points: {tensor:.0e} with"
            f" the tensor's sign, {positive:.1f} with the positive one"
        ),
        values={"tensor_relative_error": tensor, "positive_relative_error": positive},
        confirmed=tensor < EXACT < positive,
    )


def _printed_moments(body: _RigidBody, sign: int) -> Array:
    """Return K, M, N as printed; `sign` of the products of inertia: I_xy = sign int x y dm."""
    m = float(body.mass.sum())
    x, y, z = (body.mass @ body.position) / m
    products = np.einsum("k,ki,kj->ij", body.mass, body.position, body.position)
    Ixx, Iyy, Izz = np.trace(products) - np.diag(products)
    Ixy, Ixz, Iyz = sign * products[0, 1], sign * products[0, 2], sign * products[1, 2]
    (u, v, w), (p, q, r) = body.velocity, body.rate
    (du, dv, dw), (dp, dq, dr) = body.acceleration, body.rate_change
    ax, ay, az = du + q * w - r * v, dv + r * u - p * w, dw + p * v - q * u
    inertial = np.array(
        [
            Ixx * dp + Ixy * dq + Ixz * dr + (Izz - Iyy) * r * q,
            Ixy * dp + Iyy * dq + Iyz * dr + (Ixx - Izz) * p * r,
            Ixz * dp + Iyz * dq + Izz * dr + (Iyy - Ixx) * p * q,
        ]
    )
    product_terms = np.array(
        [
            Iyz * (q * q - r * r) + Ixz * p * q - Ixy * p * r,
            Ixz * (r * r - p * p) + Ixy * q * r - Iyz * q * p,
            Ixy * (p * p - q * q) + Iyz * p * r - Ixz * q * r,
        ]
    )
    offset = m * np.array([y * az - z * ay, z * ax - x * az, x * ay - y * ax])
    return np.asarray(inertial + product_terms + offset)


def _relative_error(values: Array, exact: Array) -> float:
    """Return the largest difference over the largest exact value."""
    return float(np.max(np.abs(values - exact)) / np.max(np.abs(exact)))


def _drag(sources: Sources) -> Discrepancy:
    """Check the axial drag coefficient."""
    formula, balance = sources.steps["C_D"].value, sources.steps["C_D balance"].value
    return Discrepancy(
        place="Hydrodynamics: C_D",
        printed="0.0040 pi A_p/A_f [1 + 60 (d/l)^3 + 0.0025 l/d] = 0.023",
        reading="the formula gives another value; the drag follows from the thrust at 1.3 m/s",
        evidence=f"the formula gives {formula:.3f}; the thrust balance needs {balance:.3f}",
        values={"formula": formula, "thrust_balance": balance, "printed": 0.023},
        confirmed=formula > 2.0 * 0.023 and abs(balance / formula - 1.0) < 0.25,
    )


def _drag_exponent(sources: Sources) -> Discrepancy:
    """Check the index of the axial drag coefficient."""
    coefficient = sources.steps["C_D balance"].value
    by_speed = {
        exponent: DRAG_KGPM * coefficient * CRUISE_SPEED_MPS**exponent for exponent in (1, 2)
    }
    thrust = TABLE_1_INITIAL.Y_dr - 131.0 * CRUISE_SPEED_MPS**2
    return Discrepancy(
        place="Hydrodynamics: X_{u|u}",
        printed="X_{u|u} = -1/2 rho A_f C_D",
        reading="X_{u|u|}: the drag is X u |u|",
        evidence=(
            f"with the balance's C_D the drag at 1.3 m/s is {by_speed[2]:.1f} N with u |u| and"
            f" {by_speed[1]:.1f} N with u; the thrust Y_dr - 131 U^2 is {thrust:.1f} N"
        ),
        values={"quadratic_n": by_speed[2], "linear_n": by_speed[1], "thrust_n": thrust},
        confirmed=abs(by_speed[2] - thrust) < 0.5 < abs(by_speed[1] - thrust),
    )


def _ellipsoid(sources: Sources) -> Discrepancy:
    """Check the axes of the ellipsoid of the axial added mass."""
    full = sources.steps["X_udot"].value
    halved = full / 8.0
    tail = sources.steps["Y_r"].value - full * CRUISE_SPEED_MPS
    required = (TABLE_1_INITIAL.Y_r - tail) / CRUISE_SPEED_MPS
    return Discrepancy(
        place="Hydrodynamics: axial added mass",
        printed="major axis half the length, minor axis half the diameter",
        reading="semi-axes: half the length and half the diameter",
        evidence=(
            f"X_udot is {full:.1f} kg with semi-axes and {halved:.1f} kg with axes; Table 1's Y_r"
            f" needs {required:.1f} kg"
        ),
        values={"semi_axes_kg": full, "axes_kg": halved, "table_1_kg": required},
        confirmed=abs(full - required) < abs(halved - required),
    )


def _yaw_moment_parts(sources: Sources) -> tuple[float, float]:
    """Return the tail's part -x k and the hull's part of N_v (kg m/s)."""
    tail = sources.steps["Y_r"].value - sources.steps["X_udot"].value * CRUISE_SPEED_MPS
    return tail, sources.steps["N_v"].value - tail


def _moment_indices(sources: Sources) -> Discrepancy:
    """Check the indices of the body's moment coefficients."""
    tail, hull = _yaw_moment_parts(sources)
    swapped, own = -tail, -(tail + hull)
    return Discrepancy(
        place="Hydrodynamics: C_M,pitch and C_M,yaw",
        printed="C_M,pitch = 0.123 delta_v, C_M,yaw = 0.123 delta_w",
        reading="indices swapped: pitch with w/u, yaw with v/u; delta is the incidence",
        evidence=(
            f"as printed heave gives no hull moment and M_w = {swapped:.0f} kg m/s; with w/u it is"
            f" {own:.0f}; Table 1 has {TABLE_1_INITIAL.M_w:g}"
        ),
        values={"as_printed_kgmps": swapped, "swapped_back_kgmps": own},
        confirmed=abs(own - TABLE_1_INITIAL.M_w) < abs(swapped - TABLE_1_INITIAL.M_w),
    )


def _moment_sign(sources: Sources) -> Discrepancy:
    """Check the sign of the body's moment in both planes."""
    tail, hull = _yaw_moment_parts(sources)
    same, opposite = -tail + hull, -tail - hull
    return Discrepancy(
        place="Hydrodynamics: M_Body",
        printed="-1/2 rho A_p l C_M u^2 in both planes",
        reading="+ in pitch and - in yaw, because y is to port and z up",
        evidence=(
            f"the printed sign gives M_w = {same:.0f} kg m/s, the opposite one {opposite:.0f};"
            f" Table 1 has {TABLE_1_INITIAL.M_w:g}, and N_v = {TABLE_1_INITIAL.N_v:g}"
        ),
        values={"as_printed_kgmps": same, "opposite_kgmps": opposite},
        confirmed=abs(opposite - TABLE_1_INITIAL.M_w) < abs(same - TABLE_1_INITIAL.M_w),
    )


def _munk(sources: Sources) -> Discrepancy:
    """Check the Munk moment: contained in C_M, or to be added."""
    once = sources.steps["N_v"].value
    munk = (sources.steps["Y_vdot"].value - sources.steps["X_udot"].value) * CRUISE_SPEED_MPS
    return Discrepancy(
        place="Hydrodynamics: combined Munk and lift moment",
        printed="C_M holds both; strip theory gives the added mass as well",
        reading="the Munk moment (Y_vdot - X_udot) U is not added again",
        evidence=(
            f"N_v is {once:.0f} kg m/s without and {once + munk:.0f} with it; Table 1 has"
            f" {TABLE_1_INITIAL.N_v:g}"
        ),
        values={"once_kgmps": once, "twice_kgmps": once + munk},
        confirmed=abs(once - TABLE_1_INITIAL.N_v) < abs(once + munk - TABLE_1_INITIAL.N_v),
    )


def _lift_slope(sources: Sources) -> Discrepancy:
    """Check the lift slope of the ring wing."""
    printed, slip = sources.steps["dC_L/da"].value, sources.steps["dC_L/da slip"].value
    anchors = {
        ratio: duct.ring_wing_lift_slope_per_rad(ratio) - value
        for ratio, value in INTERPOLATION_POINTS.items()
    }
    off = max(abs(value) for value in anchors.values())
    return Discrepancy(
        place="Tailcone: dC_L/dalpha",
        printed="the formula = 5.1 at AR 3.458",
        reading="the formula is right; 5.1 follows from 16/(pi s AR)^2 instead of 16/(pi (s AR)^2)",
        evidence=(
            f"the formula meets both points that it was fitted to within {off:.4f} and gives"
            f" {printed:.3f} at 3.458; with the slip {slip:.3f}"
        ),
        values={"formula_per_rad": printed, "slip_per_rad": slip, "largest_point_error": off},
        confirmed=off < 1e-3 and round(slip, 1) == 5.1 != round(printed, 1),
    )


def _duct_lift(sources: Sources) -> Discrepancy:
    """Check the lift of the duct per incidence."""
    printed, slip = sources.steps["dC_L/da"].value, sources.steps["dC_L/da slip"].value
    lift = sources.steps["duct lift"].value
    right = lift * printed / slip
    return Discrepancy(
        place="Tailcone: L = 131 U^2 alpha",
        printed="131",
        reading="rests on the same slip, with rho = 1025 kg/m3",
        evidence=f"{lift:.1f} kg/m with the slip, {right:.1f} with the printed formula",
        values={"slip_kgpm": lift, "formula_kgpm": right},
        confirmed=round(lift) == 131 != round(right),
    )


def _angle_of_attack() -> Discrepancy:
    """Check the angle of attack by the arc sine."""
    alpha = math.radians(120.0)
    velocity = np.array([math.cos(alpha), math.sin(alpha), 0.0])
    axis = np.array([1.0, 0.0, 0.0])
    across = float(np.linalg.norm(np.cross(velocity, axis)))
    by_sine = math.degrees(math.asin(min(1.0, across)))
    by_tangent = math.degrees(math.atan2(across, float(velocity @ axis)))
    return Discrepancy(
        place="Tailcone: alpha = arcsin(|v x r_1| / |v|)",
        printed="arc sine of a magnitude",
        reading="valid up to 90 deg and not at v = 0; atan2(|v x r_1|, v . r_1) holds everywhere",
        evidence=(
            f"at an incidence of 120 deg the arc sine gives {by_sine:.0f} deg, atan2"
            f" {by_tangent:.0f} deg; at v = 0 the quotient is 0/0"
        ),
        values={"arcsine_deg": by_sine, "atan2_deg": by_tangent},
        confirmed=abs(by_tangent - 120.0) < 1e-6 < abs(by_sine - 120.0),
    )


def _lift_direction(rudder_rad: float, elevator_rad: float, velocity: Array) -> Array:
    """Return the unit vector of the ring's lift in the body frame by the printed matrices."""
    sr, cr = math.sin(rudder_rad), math.cos(rudder_rad)
    se, ce = math.sin(elevator_rad), math.cos(elevator_rad)
    to_ring = np.array([[cr * ce, sr, -cr * se], [-sr * ce, cr, sr * se], [se, 0.0, ce]])
    in_ring = to_ring @ velocity
    t_2 = np.cross(in_ring, [1.0, 0.0, 0.0])
    axes = [in_ring, t_2, np.cross(in_ring, t_2)]
    to_wind = np.column_stack([axis / np.linalg.norm(axis) for axis in axes])
    return np.asarray(to_ring.T @ to_wind @ np.array([0.0, 0.0, -1.0]))


def _duct_frame() -> Discrepancy:
    """Check the frames and sign of the duct's lift."""
    ahead, slip = np.array([1.3, 0.0, 0.0]), np.array([1.3, 0.1, 0.0])
    steering = float(_lift_direction(0.1, 0.0, ahead)[1])
    nose_up = float(_lift_direction(0.0, 0.1, ahead)[2])
    damping = float(_lift_direction(0.0, 0.0, slip)[1])
    return Discrepancy(
        place="Tailcone: T_R/B, T_R/LD and F_LD = [-D, 0, -L]",
        printed="matrices and signs; t_2 and t_3 are undefined at alpha = 0",
        reading="correct as printed for alpha > 0",
        evidence=(
            f"direction of the lift: rudder +0.1 rad gives Y {steering:+.2f}, elevator +0.1 rad"
            f" Z {nose_up:+.2f} (tail to port and down, as N_dr and M_de need), sway +0.1 m/s"
            f" Y {damping:+.2f} (damping)"
        ),
        values={"rudder_y": steering, "elevator_z": nose_up, "sway_y": damping},
        confirmed=steering > 0.9 and nose_up < -0.9 and damping < -0.9,
    )


def _cutoff_radps(lag: Lag) -> float:
    """Return the frequency (rad/s) at which a second-order lag has fallen by 3 dB."""
    # |G| = 1/sqrt(2): x^2 + (4 zeta^2 - 2) x - 1 = 0 with x = (w / wn)^2.
    half = 1.0 - 2.0 * lag.damping_ratio**2
    return lag.natural_frequency_radps * math.sqrt(half + math.sqrt(half * half + 1.0))


def _largest_real_part(lag: Lag, gains: Mapping[str, float], model: str) -> float:
    """Return the largest real part of the heading loop's poles (rad/s) with a delay of 0.3 s."""
    closed = paper_poles.close_loop(
        "heading", paper_poles.models()[model], lag._replace(delay_s=DELAY_S), gains
    )
    return float(np.max(loop_transfer.poles(closed).real))


def _actuator() -> Discrepancy:
    """Check the denominator of the actuator's transfer function."""
    printed, read = LAGS["3s^2 + 4s/10 + 1"], LAGS["s^2/9 + 4s/10 + 1"]
    gain_sets = (TABLE_3_INITIAL, TABLE_3_IMPROVED)
    growth = [max(_largest_real_part(lag, g, "I") for g in gain_sets) for lag in (printed, read)]
    cutoff = [_cutoff_radps(lag) for lag in (printed, read)]
    low, high = PRINTED_CUTOFF_RADPS
    return Discrepancy(
        place="Tailcone dynamics modeling: G(s)",
        printed="1 / (3 s^2 + 4 s/10 + 1)",
        reading="1 / (s^2/9 + 4 s/10 + 1): 3 rad/s, damping 0.6",
        evidence=(
            f"cut-off {cutoff[0]:.2f} rad/s as printed and {cutoff[1]:.2f} as read (measured:"
            f" {low:g} to {high:g}); the heading loop with Table 3's gains has a pole at"
            f" {growth[0]:+.2f} as printed and none right of {growth[1]:+.3f} as read"
        ),
        values={
            "printed_cutoff_radps": cutoff[0],
            "read_cutoff_radps": cutoff[1],
            "printed_growth_per_s": growth[0],
            "read_growth_per_s": growth[1],
        },
        confirmed=low <= cutoff[1] <= high and not low <= cutoff[0] and growth[1] < 0.0 < growth[0],
    )


def _delay() -> Discrepancy:
    """Check the rational approximation of the delay."""

    def lag_deg(coefficients: tuple[float, float, float], frequency_radps: float) -> float:
        """Return the phase lag (deg) of q(-T s) / q(T s)."""
        s = 1j * frequency_radps * DELAY_S
        c_0, c_1, c_2 = coefficients
        return -math.degrees(
            cmath.phase((c_0 - c_1 * s + c_2 * s * s) / (c_0 + c_1 * s + c_2 * s * s))
        )

    printed, pade, ogata = (
        lag_deg(form, 2.0)
        for form in ((9 / 2, 1 / 9, 1 / 20), (1.0, 1 / 2, 1 / 12), (1.0, 1 / 2, 1 / 8))
    )
    exact = math.degrees(2.0 * DELAY_S)
    return Discrepancy(
        place="Tailcone dynamics modeling: delay in G(s)",
        printed="(9/2 - T s/9 + (T s)^2/20) / (9/2 + T s/9 + (T s)^2/20)",
        reading="a second-order form of exp(-T s): Pade (1, 1/2, 1/12), or Ogata (1, 1/2, 1/8)",
        evidence=(
            f"at 2 rad/s a delay of 0.3 s lags by {exact:.1f} deg; as printed {printed:.1f}, Pade"
            f" {pade:.1f}, Ogata {ogata:.1f} deg; the text says that the delay is 0.3 s"
        ),
        values={"printed_deg": printed, "pade_deg": pade, "ogata_deg": ogata, "exact_deg": exact},
        confirmed=max(abs(pade - exact), abs(ogata - exact)) < 1.0 < abs(printed - exact) / 10.0,
    )


def _rate_limits() -> Discrepancy:
    """Check the frequencies that the rate limit allows."""
    highest = {peak: 15.0 / (2.0 * peak) for peak in (30.0, 10.0)}
    sine = {peak: 15.0 / (math.pi * peak) for peak in (30.0, 10.0)}
    return Discrepancy(
        place="Tailcone dynamics modeling: 0.25 Hz and 0.75 Hz",
        printed="highest frequency passed without attenuation",
        reading="that of a triangle wave; a sine has its largest slope at a lower frequency",
        evidence=(
            f"rate / (2 A) is {highest[30.0]:.2f} and {highest[10.0]:.2f} Hz, rate / (pi A) of a"
            f" sine {sine[30.0]:.2f} and {sine[10.0]:.2f} Hz"
        ),
        values={
            **{f"triangle_{peak:g}deg_hz": value for peak, value in highest.items()},
            **{f"sine_{peak:g}deg_hz": value for peak, value in sine.items()},
        },
        confirmed=highest == {30.0: 0.25, 10.0: 0.75},
    )


def _yaw_poles(
    c: Table1Column, sway_mass: float, inertia: float, coupling: float
) -> NDArray[np.complex128]:
    """Return the roots of s^2 + a_1 s + a_0 of the printed denominator with x_CM = 0."""
    a_1 = -c.Y_v / sway_mass - c.N_r / inertia
    a_0 = (c.Y_v * c.N_r + coupling) / (sway_mass * inertia)
    return np.asarray(np.sort_complex(np.roots([1.0, a_1, a_0])))


def _transfer_function() -> list[Discrepancy]:
    """Check the denominators and last term of the yaw transfer function."""
    c, U = TABLE_1_INITIAL, CRUISE_SPEED_MPS
    exact = np.sort_complex(np.linalg.eigvals(linear_planes.yaw_plane(c).A[:2, :2]))
    mass, inertia = MASS_KG - c.Y_vdot, c.I_zz - c.N_rdot
    coupling = (MASS_KG * U - c.Y_r) * c.N_v

    def error(poles: NDArray[np.complex128]) -> float:
        """Return the largest distance of the poles (rad/s) from the state space's."""
        return float(np.max(np.abs(poles - exact)))

    right = error(_yaw_poles(c, mass, inertia, coupling))
    no_dots = error(_yaw_poles(c, MASS_KG - c.Y_v, c.I_zz - c.N_r, coupling))
    swapped = error(_yaw_poles(c, mass, inertia, (MASS_KG * U - c.Y_v) * c.N_r))
    steering, limit = c.N_dr / (c.I_zz - c.N_r), c.N_dr / inertia
    note = "distance of the poles from those of the equations of motion: "
    return [
        Discrepancy(
            place="Linearized Model: denominators of the yaw transfer function",
            printed="(m - Y_v) and (I_zz - N_r)",
            reading="(m - Y_vdot) and (I_zz - N_rdot): the dots are lost",
            evidence=(
                f"{note}{no_dots:.3f} rad/s as printed, {right:.0e} as read; N_dr / (I_zz - N_r) is"
                f" {steering:.3f}, where the paper's limit at s = infinity is {limit:.3f} 1/s^2"
            ),
            values={
                "printed_radps": no_dots,
                "read_radps": right,
                "printed_per_s2": steering,
                "limit_per_s2": limit,
            },
            confirmed=right < EXACT < no_dots and abs(steering / limit - 1.0) > 0.05,
        ),
        Discrepancy(
            place="Linearized Model: last term of the yaw transfer function",
            printed="(m U - Y_v) N_r",
            reading="(m U - Y_r) N_v",
            evidence=f"{note}{swapped:.2f} rad/s as printed, {right:.0e} as read",
            values={"printed_radps": swapped, "read_radps": right},
            confirmed=right < EXACT < swapped,
        ),
    ]


def _yaw_acceleration() -> Discrepancy:
    """Check the limit of the yaw transfer function at high frequency."""
    plane = linear_planes.yaw_plane(TABLE_1_INITIAL)
    s = 1e6
    psi = float(np.linalg.solve(s * np.eye(3) - plane.A, plane.B)[2])
    first, second = -s * psi, -s * s * psi
    ratio = TABLE_1_INITIAL.N_dr / (TABLE_1_INITIAL.I_zz - TABLE_1_INITIAL.N_rdot)
    return Discrepancy(
        place="Linearized Model: at s = infinity, phi-dot / delta_r; (I_zz - N_r phi-dot)",
        printed="one dot; N_r phi-dot",
        reading="psi-two-dots / delta_r = N_dr / (I_zz - N_rdot)",
        evidence=(
            f"s times the transfer function tends to {first:.0e}, s^2 times it to {second:.3f};"
            f" N_dr / (I_zz - N_rdot) is {ratio:.3f} 1/s^2"
        ),
        values={"once_per_s": first, "twice_per_s2": second, "ratio_per_s2": ratio},
        confirmed=abs(second - ratio) < 1e-3 and abs(first) < 1e-3,
    )


def _accelerations(c: Table1Column) -> tuple[float, float]:
    """Return N_dr / (I_zz - N_rdot) and M_de / (I_yy - M_qdot) (1/s^2)."""
    return c.N_dr / (c.I_zz - c.N_rdot), c.M_de / (c.I_yy - c.M_qdot)


def _measured_accelerations() -> Discrepancy:
    """Check the angular accelerations -0.51 and -0.46."""
    initial, adjusted = _accelerations(TABLE_1_INITIAL), _accelerations(TABLE_1_ADJUSTED)
    measured = tuple(ACCELERATION_PER_S2.values())
    return Discrepancy(
        place="Vehicle Simulation: r-dot/delta_R = -0.51, q-dot/delta_E = -0.46",
        printed="known from step data",
        reading="ties I_zz and I_yy of the adjusted column to N_dr and M_de, by construction",
        evidence=(
            f"the adjusted column gives {adjusted[0]:.3f} and {adjusted[1]:.3f}, the initial one"
            f" {initial[0]:.3f} and {initial[1]:.3f} 1/s^2"
        ),
        values={
            "adjusted_yaw_per_s2": adjusted[0],
            "adjusted_pitch_per_s2": adjusted[1],
            "initial_yaw_per_s2": initial[0],
            "initial_pitch_per_s2": initial[1],
        },
        confirmed=np.allclose(adjusted, measured, atol=0.005)
        and not np.allclose(initial, measured, atol=0.005),
    )


def _lever_arms() -> Discrepancy:
    """Check the position of the duct that the adjusted column implies."""
    c = TABLE_1_ADJUSTED
    yaw, pitch = c.N_dr / c.Y_dr, c.M_de / c.Z_de
    initial = TABLE_1_INITIAL.N_dr / TABLE_1_INITIAL.Y_dr
    return Discrepancy(
        place="Table 1: adjusted N_dr / Y_dr and M_de / Z_de",
        printed="-513/264 and -514/-270",
        reading="the adjusted column is an effective model: its duct lies behind the hull's end",
        evidence=(
            f"lever arms {abs(yaw):.3f} and {abs(pitch):.3f} m ({abs(initial):.3f} m initially);"
            f" the hull ends at {HALF_LENGTH_M:.3f} m"
        ),
        values={"yaw_m": abs(yaw), "pitch_m": abs(pitch), "initial_m": abs(initial)},
        confirmed=min(abs(yaw), abs(pitch)) > HALF_LENGTH_M + 0.1 > abs(initial),
    )


def _side_force(sources: Sources) -> Discrepancy:
    """Check Y_v of the initial column."""
    formula, slip = sources.steps["Y_v"].value, sources.steps["Y_v slip"].value
    return Discrepancy(
        place="Table 1: Y_v and Z_w, initial",
        printed="-449",
        reading="the hull's lift was multiplied by U^2 a second time",
        evidence=f"the formulas give {formula:.0f} kg/s, with U^2 twice {slip:.1f}",
        values={"formula_kgps": formula, "twice_kgps": slip},
        confirmed=round(slip) == TABLE_1_INITIAL.Y_v != round(formula),
    )


def _table_4(sources: Sources) -> Discrepancy:
    """Check the consistency of Table 4 with Tables 1 and 3."""
    best = min(sources.readings, key=lambda reading: reading.misfit_radps)
    delays = [row.delay_s for row in sources.alone]
    sd_s = max(row.delay_sd_s for row in sources.alone)
    return Discrepancy(
        place="Table 4 with Tables 1 and 3",
        printed="nine dominant pole pairs",
        reading="contradictory: mass, x_CM and delay of each row are not printed",
        evidence=(
            f"of {len(sources.readings)} readings of the tailcone none explains all nine within"
            f" 10 %; the best one misses by {best.misfit_radps:.2f} rad/s rms. The rows alone imply"
            f" delays of {min(delays):.2f} to {max(delays):.2f} s, each +- {sd_s:.2f} s"
        ),
        values={
            "best_misfit_radps": best.misfit_radps,
            "smallest_delay_s": min(delays),
            "largest_delay_s": max(delays),
        },
        confirmed=all(reading.remain for reading in sources.readings)
        and max(delays) - min(delays) > 3.0 * sd_s,
    )


def _integrator_limit() -> Discrepancy:
    """Check the heading error that the rudder bias leaves with Table 3's first integrator limit."""
    limit, gain = TABLE_3_INITIAL["HDG_IMAX"], TABLE_3_INITIAL["HDG_P"]
    error_deg = math.degrees((FIGURE_7_BIAS_RAD - limit) / gain)
    return Discrepancy(
        place="Table 3: integrator limit 0.01; figure 7: bias of -6 deg; Table 5: +-2.5 deg",
        printed="no units of gains and limits, no trim",
        reading="gains in rad/rad, limits in rad; the vehicle was trimmed before Table 5",
        evidence=(
            f"untrimmed, the bias leaves a heading error of {error_deg:.1f} deg, where Table 5 has"
            " 2.5"
        ),
        values={"untrimmed_error_deg": error_deg},
        confirmed=error_deg > 2.0 * 2.5,
    )
