"""Consistency checks of a vehicle file, and predictions: trim at rest and in motion, poles, roll.

Axes are the paper's: body x forward, y port, z up, so theta is positive nose down. The report uses
pitch positive nose up.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, cos, degrees, inf, isnan, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from sitl.vehicle import build_model, dynamics, hull
from sitl.vehicle.file_schema import VehicleConfig, VehicleFileError
from sitl.vehicle.linearise import DEPTH_M, LinearisedPlane, linearise
from sitl.vehicle.model import Hydrostatics, Inertia, VehicleModel
from sitl.vehicle.vectors import Vector
from sitl.vehicle.water import STILL

TRIANGLE_SLACK = 1e-9
"""Relative tolerance of the triangle inequality between principal moments of inertia."""
MASS_RATIO = (0.5, 2.0)
"""Range of the mass over that of the water that the hull displaces: beyond it a unit is wrong."""
BUOYANCY_RATIO = (0.5, 1.25)
"""Range of the buoyancy over that of the hull: parts of a hull may be flooded, and duct, fins and
masts displace water besides."""
MAX_FLOAT_PITCH_DEG, MAX_HEEL_DEG = 20.0, 10.0
"""Pitch and heel at rest above which there is a warning: ballast is far from its place.

A vehicle that heels moves both planes with either surface, and such tests are left out of a fit."""
MAX_TRIM_SHARE = 0.4
"""Share of the elevator's travel for level motion above which there is a warning.

The design of tests reserves as much for an unknown trim; the paper's vehicle needed 6 of 15 deg."""
STEP = 1e-6
"""Step of the central differences and tolerance of Newton's method, SI units and radians."""


class PoleMode(NamedTuple):
    """Pole of a linear plane at the operating point."""

    real_radps: float
    imag_radps: float
    time_constant_s: float
    """Positive for a decaying mode, negative for a growing one, infinite for an integrator."""


class LinearPlaneReport(NamedTuple):
    """Linear plane x' = A x + B delta in axes x forward, y port, z up."""

    states: tuple[str, ...]
    A: list[list[float]]
    B: list[float]
    poles: list[PoleMode]
    moment_hull_nm: float
    """Moment of the hull per radian of incidence, Munk moment plus lift; positive is unstable."""
    moment_tail_nm: float
    """Moment of the tail per radian of incidence; it counteracts that of the hull."""
    straight_line_index: float
    """Straight-line stability index; positive where straight motion is stable without control.

    Yaw: 1 - N_v (Y_r - m U)/(Y_v (N_r - m x U)); pitch: the same with its own coefficients."""


class Report(NamedTuple):
    """Result of ``check``: SI units, angles in degrees, pitch positive nose up."""

    name: str
    length_m: float
    mass_kg: float
    net_buoyancy_n: float
    float_pitch_deg: float
    """Pitch at rest under water, with the centre of buoyancy above the centre of mass."""
    float_heel_deg: float
    """Roll angle at rest under water."""
    speed_mps: float
    """Speed of the operating point."""
    level_pitch_deg: float
    """Pitch in level motion at ``speed_mps``."""
    level_elevator_deg: float
    """Elevator in level motion at ``speed_mps``."""
    full_speed_mps: float
    """Steady speed at 100 % thrust."""
    roll_period_s: float
    """Undamped period at rest."""
    roll_damping: float
    """Damping ratio at rest."""
    roll_damping_under_way: float
    """Damping ratio at ``speed_mps``."""
    pitch_period_s: float
    """Undamped period at rest."""
    yaw: LinearPlaneReport
    pitch: LinearPlaneReport
    warnings: list[str]


def check_config(config: VehicleConfig, source: str) -> Report:
    """Check the physics of a vehicle and predict its behaviour.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle with all keys.
    source : str
        Name of the file in error messages.

    Returns
    -------
    Report
        Trim, speeds, periods, linear planes and warnings.

    Raises
    ------
    VehicleFileError
        The vehicle is physically impossible.
    """
    with np.errstate(all="ignore"):
        try:
            report = _check_physics(config, source)
        except np.linalg.LinAlgError:
            report = None
    if report is None or any(isnan(value) for value in _numbers(report)):
        raise VehicleFileError(
            f"{source}: its values give no finite linear model at operating_point.speed_mps ="
            f" {config.operating_point.speed_mps:g}; give SI units"
        )
    return report


def _numbers(value: object) -> Iterator[float]:
    """Yield all numbers of a report."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, tuple | list):
        for entry in value:
            yield from _numbers(entry)


def _check_physics(config: VehicleConfig, source: str) -> Report:
    """Return the report of `check_config`, in which a number may be nan."""
    _check_displacement(config, source)
    model = build_model.build(config, source)
    warnings = check_consistency(config, model, source)
    point = config.operating_point
    level_rad = level_flight(model, point.speed_mps, point.thrust_fraction)
    if level_rad is None:
        raise VehicleFileError(
            f"{source}: operating_point.speed_mps = {point.speed_mps:g}: expected a speed at"
            " which level motion is possible with a net buoyancy of"
            f" {model.hydrostatics.buoyancy_n - model.hydrostatics.weight_n:.3g} N and"
            f" ballast.x_cm_m = {config.ballast.x_cm_m:.4g}, x_cb_m = {config.ballast.x_cb_m:.4g}"
        )
    return _report(config, model, level_rad, warnings)


def _check_displacement(config: VehicleConfig, source: str) -> None:
    """Raise ``VehicleFileError`` for a mass or buoyancy that the hull cannot have."""
    ballast, water = config.ballast, config.water
    hull_kg = water.density_kgpm3 * hull.integrals(config.hull).volume_m3
    weight_n, hull_n = ballast.mass_kg * water.gravity_mps2, hull_kg * water.gravity_mps2
    displaced = f"the hull displaces {hull_kg:.4g} kg of water"
    low, high = MASS_RATIO
    if not low <= ballast.mass_kg / hull_kg <= high:
        raise VehicleFileError(
            f"{source}: ballast.mass_kg = {ballast.mass_kg:.6g} with net_buoyancy_n ="
            f" {ballast.net_buoyancy_n:.6g}: expected {low * hull_kg:.4g} to {high * hull_kg:.4g}"
            f" kg: {displaced}"
        )
    low, high = BUOYANCY_RATIO
    if not low <= (weight_n + ballast.net_buoyancy_n) / hull_n <= high:
        raise VehicleFileError(
            f"{source}: ballast.net_buoyancy_n = {ballast.net_buoyancy_n:.6g} with mass_kg ="
            f" {ballast.mass_kg:.6g}: expected {low * hull_n - weight_n:.4g} to"
            f" {high * hull_n - weight_n:.4g} N: {displaced}"
        )


def check_consistency(config: VehicleConfig, model: VehicleModel, source: str) -> list[str]:
    """Return warnings about unusual values; raise ``VehicleFileError`` for impossible ones."""
    h, length = model.hydrostatics, hull.length_m(config.hull)
    if h.z_cm_m >= h.z_cb_m:
        raise VehicleFileError(
            f"{source}: linear.z_CM_m = {h.z_cm_m:.4g}: expected below the centre of buoyancy, "
            f"ballast.z_cb_m = {h.z_cb_m:.4g}; otherwise the vehicle capsizes"
        )
    for name, x, z in (("x_cm_m", h.x_cm_m, h.z_cm_m), ("x_cb_m", h.x_cb_m, h.z_cb_m)):
        radius = float(hull.radius_m(config.hull, np.array(x)))
        if abs(z) >= radius:
            raise VehicleFileError(
                f"{source}: ballast.{name} = {x:.4g}, z {z:.4g}: expected inside the hull"
            )
    moments = principal_inertia(model.inertia)
    triangle_excess = moments[2] / (moments[0] + moments[1]) - 1
    warnings = []
    if triangle_excess > TRIANGLE_SLACK:
        moments_text = (
            f"I = {moments[0]:.4g}, {moments[1]:.4g}, {moments[2]:.4g} kg m2 about the centre of"
            " mass"
        )
        if not config.effective:
            raise VehicleFileError(
                f"{source}: linear.I_yy_kgm2 and I_zz_kgm2: {moments_text}: expected none above the"
                " sum of the other two, or effective = true for identified coefficients"
            )
        warnings.append(f"effective coefficients: {moments_text}, which no rigid body has")
    displaced_n = (
        config.water.density_kgpm3 * hull.integrals(config.hull).volume_m3 * h.gravity_mps2
    )
    if abs(h.buoyancy_n / displaced_n - 1) > 0.02:
        warnings.append(
            f"buoyancy is {h.buoyancy_n:.0f} N, and the hull displaces {displaced_n:.0f} N"
        )
    if h.buoyancy_n < h.weight_n:
        warnings.append(f"the vehicle sinks: {h.weight_n - h.buoyancy_n:.3g} N heavier than water")
    if length / config.hull.diameter_m < 4:
        warnings.append("shorter than four diameters: the formulas hold for a slender body")
    return warnings


def principal_inertia(inertia: Inertia) -> Vector:
    """Return the principal moments of inertia about the centre of mass, ascending, kg m2."""
    # Parallel-axis theorem: I_CM = I_o - m (r.r I - r r^T), r = (x, y, z) the centre of mass.
    m, M = inertia.mass_kg, inertia.M_RB
    z, x, y = M[0, 4] / m, M[1, 5] / m, M[2, 3] / m
    about_origin = M[3:, 3:]
    r = np.array([x, y, z])
    return np.asarray(np.linalg.eigvalsh(about_origin - m * (r @ r * np.eye(3) - np.outer(r, r))))


def _report(
    config: VehicleConfig, model: VehicleModel, level_rad: tuple[float, float], warnings: list[str]
) -> Report:
    """Return the report of a valid vehicle; ``level_rad`` is (pitch nose up, elevator)."""
    # With BG = z_CB - z_CM: roll frequency sqrt(W BG / M_44), pitch frequency sqrt(W BG / M_55).
    h, U = model.hydrostatics, config.operating_point.speed_mps
    height_of_cb = h.z_cb_m - h.z_cm_m
    pitch, elevator = level_rad
    warnings = [
        *warnings,
        *_trim_warnings(config, h, degrees(elevator)),
        *_stall_warnings(config),
    ]
    stiffness = h.weight_n * height_of_cb
    roll = sqrt(stiffness / model.inertia.M[3, 3])
    planes = linearise(model, U)
    yaw, pitch_plane = (
        _plane(planes.yaw, ("v", "r", "psi"), model, U),
        _plane(planes.pitch, _PITCH, model, U),
    )
    for name, plane in (("yaw", yaw), ("pitch", pitch_plane)):
        if plane.straight_line_index < 0:
            warnings = [
                *warnings,
                f"straight motion is unstable in {name} without control",
            ]
    return Report(
        name=config.name,
        length_m=hull.length_m(config.hull),
        mass_kg=model.inertia.mass_kg,
        net_buoyancy_n=h.buoyancy_n - h.weight_n,
        float_pitch_deg=_float_pitch_deg(h),
        float_heel_deg=_float_heel_deg(h),
        speed_mps=U,
        level_pitch_deg=degrees(pitch),
        level_elevator_deg=degrees(elevator),
        full_speed_mps=top_speed_mps(model),
        roll_period_s=2 * pi / roll,
        roll_damping=_roll_damping_nms(model, 0.0) / (2 * roll * model.inertia.M[3, 3]),
        roll_damping_under_way=_roll_damping_nms(model, U) / (2 * roll * model.inertia.M[3, 3]),
        pitch_period_s=2 * pi * sqrt(model.inertia.M[4, 4] / stiffness),
        yaw=yaw,
        pitch=pitch_plane,
        warnings=warnings,
    )


def _float_pitch_deg(h: Hydrostatics) -> float:
    """Return the pitch at rest under water (deg), positive nose up."""
    return degrees(atan2(h.x_cb_m - h.x_cm_m, h.z_cb_m - h.z_cm_m))


def _float_heel_deg(h: Hydrostatics) -> float:
    """Return the roll angle at rest under water (deg)."""
    return degrees(atan2(-h.y_cm_m, h.z_cb_m - h.z_cm_m))


def _trim_warnings(config: VehicleConfig, h: Hydrostatics, elevator_deg: float) -> list[str]:
    """Return warnings about a vehicle that floats far from level, or is hard to trim."""
    warnings, travel_deg = [], config.tailcone.travel_deg
    if abs(pitch_deg := _float_pitch_deg(h)) > MAX_FLOAT_PITCH_DEG:
        x_cb_m = round(h.x_cb_m, 5) + 0.0  # the sum turns -0 into 0
        warnings.append(
            f"floats at pitch {pitch_deg:+.0f} deg: ballast.x_cm_m = {h.x_cm_m:.4g}: expected near"
            f" ballast.x_cb_m = {x_cb_m:g}"
        )
    if abs(heel_deg := _float_heel_deg(h)) > MAX_HEEL_DEG:
        warnings.append(
            f"floats at heel {heel_deg:+.0f} deg: ballast.y_cm_m = {h.y_cm_m:.4g}: expected near 0"
        )
    if abs(elevator_deg) > travel_deg:
        warnings.append(f"level motion needs {elevator_deg:.0f} deg of elevator, beyond its travel")
    elif abs(elevator_deg) > MAX_TRIM_SHARE * travel_deg:
        warnings.append(
            f"level motion needs {elevator_deg:.1f} of {travel_deg:g} deg of elevator: trim the"
            " vehicle by ballast"
        )
    return warnings


def _stall_warnings(config: VehicleConfig) -> list[str]:
    """Return a warning about fins that turn beyond stall, where they lose force."""
    fins, travel_deg = config.fins, config.tailcone.travel_deg
    if fins is None or travel_deg <= fins.stall_deg:
        return []
    return [
        f"tailcone.travel_deg = {travel_deg:g}: fins lose force beyond fins.stall_deg ="
        f" {fins.stall_deg:g}, and at slow speed full rudder and elevator may spin the vehicle:"
        " limit the travel"
    ]


_PITCH = ("w", "q", "theta", "depth")


def _plane(
    plane: LinearisedPlane, states: tuple[str, ...], model: VehicleModel, U: float
) -> LinearPlaneReport:
    """Return poles, moments per radian of incidence and stability index of a plane."""
    # Hull: U^2 (N_uv - (A_v - A_u)), Munk moment included; whole vehicle: N_v U. In pitch
    # M_w has the opposite sign of N_v in these axes.
    F, sign = plane.F, 1 if states[0] == "v" else -1
    A_u, A_v = (
        model.inertia.M_A[0, 0],
        model.inertia.M_A[1 if sign > 0 else 2, 1 if sign > 0 else 2],
    )
    lift = model.hull.N_uv_kg if sign > 0 else -model.hull.M_uw_kg
    hull_moment = U**2 * (lift - (A_v - A_u))
    total_moment = sign * F[1, 0] * U
    return LinearPlaneReport(
        states=states,
        A=plane.A.tolist(),
        B=plane.B[:, 0].tolist(),
        poles=[
            _mode(complex(pole))
            for pole in sorted(np.linalg.eigvals(plane.A), key=abs, reverse=True)
        ],
        moment_hull_nm=-hull_moment,
        moment_tail_nm=total_moment - hull_moment,
        straight_line_index=float(1 - F[1, 0] * F[0, 1] / (F[0, 0] * F[1, 1])),
    )


def _mode(pole: complex) -> PoleMode:
    """Return a pole with its time constant -1/Re."""
    return PoleMode(pole.real, pole.imag, -1 / pole.real if abs(pole.real) > 1e-9 else inf)


def _accelerations(
    model: VehicleModel, nu: Vector, theta_rad: float, elevator_rad: float, shaft_rps: float
) -> Vector:
    """Return nu' in deep, still water at pitch angle ``theta_rad``, positive nose down."""
    state, rate = dynamics.state_at_rest(-DEPTH_M), np.empty(dynamics.STATE_SIZE)
    state[3], state[5] = cos(theta_rad / 2), sin(theta_rad / 2)
    state[dynamics.NU] = nu
    dynamics.derivative(state, 0.0, elevator_rad, shaft_rps, np.zeros(6), STILL, model, rate)
    return rate[dynamics.NU]


def level_flight(
    model: VehicleModel, speed_mps: float, thrust_fraction: float
) -> tuple[float, float] | None:
    """Return (pitch nose up, elevator) in rad for motion at constant depth; None if impossible."""
    # Newton's method on heave and pitch acceleration, with nu = U (cos theta, 0, sin theta, 0...).

    def unbalanced(x: Vector) -> Vector:
        """Return heave (m/s2) and pitch (rad/s2) acceleration at x = (-theta, elevator), rad."""
        theta, elevator = -float(x[0]), float(x[1])
        nu = np.array([speed_mps * cos(theta), 0.0, speed_mps * sin(theta), 0.0, 0.0, 0.0])
        return _accelerations(
            model, nu, theta, elevator, thrust_fraction * model.propeller.full_rps
        )[[2, 4]]

    x = np.zeros(2)
    for _ in range(20):
        slopes = np.column_stack(
            [unbalanced(x + STEP * e) - unbalanced(x - STEP * e) for e in np.eye(2)]
        ) / (2 * STEP)
        try:
            step = np.linalg.solve(slopes, unbalanced(x))
        except np.linalg.LinAlgError:
            return None
        x = x - step
    converged = abs(step).max() < STEP and abs(x).max() < pi / 2
    return (float(x[0]), float(x[1])) if converged else None


def top_speed_mps(model: VehicleModel) -> float:
    """Return the steady speed of straight motion at 100 % thrust, m/s, by bisection."""
    low, high = 0.0, 30.0
    for _ in range(60):
        middle = (low + high) / 2
        nu = np.array([middle, 0.0, 0.0, 0.0, 0.0, 0.0])
        surge = _accelerations(model, nu, 0.0, 0.0, model.propeller.full_rps)[0]
        low, high = (middle, high) if surge > 0 else (low, middle)
    return (low + high) / 2


def _roll_damping_nms(model: VehicleModel, speed_mps: float) -> float:
    """Return the roll damping -dK/dp in straight motion, N m s."""
    rolling = [np.array([speed_mps, 0.0, 0.0, p, 0.0, 0.0]) for p in (STEP, -STEP)]
    ahead, behind = (_accelerations(model, nu, 0.0, 0.0, 0.0) for nu in rolling)
    return float(-(model.inertia.M @ (ahead - behind))[3] / (2 * STEP))


def format_text(report: Report) -> str:
    """Return the report as text."""
    lines = [
        (
            f"{report.name}: {report.length_m:.3f} m, {report.mass_kg:.4g} kg,"
            f" {report.net_buoyancy_n:+.3g} N net buoyancy"
        ),
        (
            f"floats at    pitch {report.float_pitch_deg:+.2f} deg, heel"
            f" {report.float_heel_deg:+.2f} deg"
        ),
        (
            f"level        at {report.speed_mps:.3g} m/s with pitch {report.level_pitch_deg:+.2f}"
            f" deg, elevator {report.level_elevator_deg:+.2f} deg; {report.full_speed_mps:.2f} m/s"
            " at 100 % thrust"
        ),
        (
            f"roll         period {report.roll_period_s:.2f} s, damping ratio"
            f" {report.roll_damping:.2f} at rest, {report.roll_damping_under_way:.2f} under way"
        ),
        f"pitch        period {report.pitch_period_s:.2f} s at rest",
    ]
    for name, surface, plane in (
        ("yaw", "rudder", report.yaw),
        ("pitch", "elevator", report.pitch),
    ):
        poles = ", ".join(_format_mode(mode) for mode in plane.poles)
        lines += [
            "",
            (
                f"{name} plane at {report.speed_mps:.3g} m/s; x' = A x + B"
                f" {surface}, x = ({', '.join(plane.states)}), SI"
                " units and radians, axes forward, port, up"
            ),
            *(f"  A {_row(row)}   B {b:10.5g}" for row, b in zip(plane.A, plane.B, strict=True)),
            f"  poles, rad/s (time constant, s): {poles}",
            (
                f"  moment per radian of incidence, N m: hull {plane.moment_hull_nm:+.4g}"
                f" (destabilising), tail {plane.moment_tail_nm:+.4g} (stabilising)"
            ),
            (
                f"  straight-line stability index {plane.straight_line_index:+.3f} "
                f"({'stable' if plane.straight_line_index > 0 else 'unstable'} without control)"
            ),
        ]
    return "\n".join([*lines, *(f"warning: {text}" for text in report.warnings)])


def _row(row: list[float]) -> str:
    """Return the numbers of a matrix row in columns."""
    return " ".join(f"{value:10.5g}" for value in row)


def _format_mode(mode: PoleMode) -> str:
    """Return a pole as text, time constant in parentheses."""
    oscillating = (
        f" {'+' if mode.imag_radps > 0 else '-'} {abs(mode.imag_radps):.3g}i"
        if mode.imag_radps
        else ""
    )
    return f"{mode.real_radps:.3g}{oscillating} ({mode.time_constant_s:.3g})"
