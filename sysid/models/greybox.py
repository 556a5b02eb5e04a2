"""Grey-box model of one plane, driven by logged commands: the model that identification fits.

Forces come from ``sitl.vehicle``; only the motion is restricted to a plane, so a run is simulated
without the drift of the other plane. States, in the paper's FLU axes (y port, z up):

    yaw:    (u, v, r, psi, -)     m/s, m/s, rad/s, rad
    pitch:  (u, w, q, theta, z)   m/s, m/s, rad/s, rad (positive nose down), m (positive up)

Equations: M_p (u', v' or w', rate')^T = sum of forces in the plane, with M_p the 3 x 3 block of
M_RB + M_A that belongs to the plane (Fossen 2021; ``sitl.vehicle.dynamics``), and Euler kinematics

    psi' = (q sin phi + r cos phi) / cos theta,   theta' = q cos phi - r sin phi,
    z' = R^T z . (u, v, w).

Inputs and outputs of the module are in MAVLink's axes (FRD, NED): the signs of v, w, rates, angles
and depth are opposite. Surface angles have the same sign in both: positive rudder turns the nose to
starboard, positive elevator turns it up.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from sitl.vehicle import duct, dynamics, hydrodynamics, propeller, restoring
from sitl.vehicle.jit import kernel
from sitl.vehicle.model import VehicleModel
from sysid.data.segments import RATE_HZ, Plane, Run

Array = NDArray[np.float64]

SUBMERGED_Z_M = -50.0
"""Height of the simulated vehicle, deep enough that the surface has no effect."""
N_COUPLING = 6
"""Number of cross-plane inputs.

They are the other plane's cross speed, rate and pitch, roll rate, roll, and the angle of the other
surface, in the paper's axes."""
SMOOTHING = 101
"""Samples (2 s) over which the other plane's motion is smoothed; a closed loop changes it slowly.
"""
SETTLING_S = 0.5
"""Duration at the start of a run over which measured initial values are averaged."""


class Actuator(NamedTuple):
    """One tailcone axis: travel limit, delay, second-order lag, rate limit, backlash, bias."""

    delay_s: float
    """Transport delay from command to motor."""
    natural_frequency_radps: float
    damping_ratio: float
    """Damping ratio; less than 1."""
    bias_rad: float
    """Duct angle at a command of zero."""
    travel_rad: float
    """Limit of the command and of the motor angle."""
    rate_radps: float
    """Rate limit of the motor."""
    backlash_rad: float = 0.0
    """Backlash between motor and duct, full width."""


class InitialMotion(NamedTuple):
    """Measured motion at the first sample, in MAVLink's axes."""

    rate_radps: float
    """Yaw or pitch rate."""
    angle_rad: float
    """Heading or pitch."""
    depth_m: float
    depth_rate_mps: float


class PlaneTrajectory(NamedTuple):
    """Simulated run in MAVLink's axes, one row per ``stride`` samples of the run's grid."""

    rate_radps: Array
    """Yaw or pitch rate."""
    angle_rad: Array
    """Heading (unwrapped) or pitch."""
    depth_m: Array
    speed_mps: Array
    """Forward speed u through the water."""


@kernel
def duct_angles(command: Array, actuator: Actuator, dt: float) -> Array:
    """Return the true duct angle (rad) at every sample of a zero-order-hold command (rad)."""
    # Per sample: command limited to the travel and delayed by delay_s = (whole + part) dt; lag and
    # rate limit by ``step_actuator``; backlash: |duct - motor| <= backlash/2; then the bias.
    n = command.size
    angles = np.empty(n)
    c, s = lag_coefficients(actuator, dt)
    late = actuator.delay_s / dt
    whole = int(late)
    part = late - whole
    angle, rate = command[0], 0.0
    duct_angle, slack = angle, 0.5 * actuator.backlash_rad
    for k in range(n):
        duct_angle = min(max(duct_angle, angle - slack), angle + slack)
        angles[k] = duct_angle + actuator.bias_rad
        newer = min(max(command[max(0, k - whole)], -actuator.travel_rad), actuator.travel_rad)
        older = min(max(command[max(0, k - whole - 1)], -actuator.travel_rad), actuator.travel_rad)
        # A command edge inside the interval: the input is the mean, exact to second order in dt.
        angle, rate = step_actuator(actuator, angle, rate, newer + part * (older - newer), c, s, dt)
    return angles


@kernel
def lag_coefficients(actuator: Actuator, dt: float) -> tuple[float, float]:
    """Return c = e^(-zeta wn dt) cos(wd dt) and s = e^(-zeta wn dt) sin(wd dt) / wd."""
    # wd = wn sqrt(1 - zeta^2): damped natural frequency, rad/s.
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    damped = wn * math.sqrt(1.0 - zeta * zeta)
    decay = math.exp(-zeta * wn * dt)
    return decay * math.cos(damped * dt), decay * math.sin(damped * dt) / damped


@kernel
def step_actuator(
    actuator: Actuator, angle: float, rate: float, target: float, c: float, s: float, dt: float
) -> tuple[float, float]:
    """Return the motor's angle (rad) and rate (rad/s) after ``dt`` towards a constant target.

    ``c`` and ``s`` are from ``lag_coefficients``. Rate and angle are limited after the exact lag.
    """
    # x'' + 2 zeta wn x' + wn^2 (x - target) = 0 with e = x - target, exact over dt:
    #     e(dt)  = (c + zeta wn s) e + s x',
    #     x'(dt) = -wn^2 s e + (c - zeta wn s) x'.
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    error = angle - target
    free = target + (c + zeta * wn * s) * error + s * rate
    rate = -wn * wn * s * error + (c - zeta * wn * s) * rate
    max_change = actuator.rate_radps * dt
    angle += min(max(free - angle, -max_change), max_change)
    rate = min(max(rate, -actuator.rate_radps), actuator.rate_radps)
    if abs(angle) > actuator.travel_rad:
        angle, rate = math.copysign(actuator.travel_rad, angle), 0.0
    return angle, rate


def duct_along(run: Run, surface: Plane, actuator: Actuator) -> Array:
    """Return the true angle (rad) of a plane's surface at every sample of a run, (samples,)."""
    return duct_angles(run.history_rad(surface), actuator, 1.0 / RATE_HZ)[-run.time_s.size :]


@kernel
def _slopes(
    x: Array,
    duct_rad: float,
    coupling: Array,
    rps: float,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    out: Array,
) -> None:
    """Write the derivative of (u, v, r, psi, -) or (u, w, q, theta, z) into ``out``.

    The water is deep and still, the axes are the paper's. ``coupling`` holds the cross-plane
    inputs: the other plane's cross speed, rate and pitch (0 where pitch is a state), roll rate,
    roll, and the angle of the other surface. ``inverse`` is from ``constraint``.
    """
    # Sum of forces: -C(nu) nu, hydrostatics, crossflow drag, hull lift and drag, tail, and duct
    # interaction; see ``sitl.vehicle.dynamics``. (u', cross', rate') = M_p^-1 (X, side, moment).
    u, p, roll = x[0], coupling[3], coupling[4]
    if is_yaw:
        v, r, w, q, theta, rudder, elevator = (
            x[1],
            x[2],
            coupling[0],
            coupling[1],
            coupling[2],
            duct_rad,
            coupling[5],
        )
    else:
        w, q, v, r, theta, rudder, elevator = (
            x[1],
            x[2],
            coupling[0],
            coupling[1],
            x[3],
            coupling[5],
            duct_rad,
        )
    level = math.cos(theta)
    up = (-math.sin(theta), math.sin(roll) * level, math.cos(roll) * level)
    nu = (u, v, w, p, q, r)
    axis = duct.ring_axis(model.duct.vectored * rudder, model.duct.vectored * elevator)
    coriolis = dynamics.coriolis(nu, model.inertia)
    static = restoring.wrench(SUBMERGED_Z_M, up[0], up, 1.0, model.hydrostatics, model.stations)
    crossflow = hydrodynamics.crossflow_drag(v, w, q, r, model.stations)
    hull = hydrodynamics.lift_and_drag(u, v, w, p, q, r, model.hull)
    tail = dynamics.tail(nu, axis, rudder, elevator, rps, 1.0, model)
    interaction = hydrodynamics.duct_interaction(u * abs(u), rudder, elevator, model.hull)
    X = coriolis[0] + static[0] + crossflow[0] + hull[0] + tail[0] + interaction[0]
    if is_yaw:
        side = coriolis[1] + static[1] + crossflow[1] + hull[1] + tail[1] + interaction[1]
        moment = coriolis[5] + static[5] + crossflow[5] + hull[5] + tail[5] + interaction[5]
        out[3] = (q * math.sin(roll) + r * math.cos(roll)) / level
        out[4] = 0.0
    else:
        side = coriolis[2] + static[2] + crossflow[2] + hull[2] + tail[2] + interaction[2]
        moment = coriolis[4] + static[4] + crossflow[4] + hull[4] + tail[4] + interaction[4]
        out[3] = q * math.cos(roll) - r * math.sin(roll)
        out[4] = up[0] * u + up[1] * v + up[2] * w
    for k in range(3):
        out[k] = inverse[k, 0] * X + inverse[k, 1] * side + inverse[k, 2] * moment


@kernel
def integrate(
    x0: Array,
    duct: Array,
    rps: Array,
    stride: int,
    dt: float,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    coupling: Array | None = None,
) -> Array:
    """Integrate one plane with classical Runge-Kutta; return rows (u, v|w, rate, angle, z).

    One step covers ``stride`` samples of ``dt`` seconds. ``duct`` (rad) and ``rps`` (rev/s) are
    sampled at ``dt``; ``inverse`` is from ``constraint``; ``coupling`` has shape
    (samples, N_COUPLING) and is zero if left out.
    """
    # Stages at 0, h/2, h/2 and h, h = dt stride. At a half step between two samples the inputs are
    # the mean of the two (indices early and late).
    rows = (duct.size - 1) // stride + 1
    track = np.empty((rows, 5))
    slope, stage_state, total = np.empty(5), np.empty(5), np.empty(5)
    inputs, x = np.zeros(N_COUPLING), x0.copy()
    track[0] = x
    h = dt * stride
    for row in range(1, rows):
        a = (row - 1) * stride
        total[:] = 0.0
        for stage in range(4):
            early = a + stride // 2 if 0 < stage < 3 else a + stride * (stage == 3)
            late = a + (stride + 1) // 2 if 0 < stage < 3 else early
            if coupling is not None:
                for i in range(N_COUPLING):
                    inputs[i] = 0.5 * (coupling[early, i] + coupling[late, i])
            stage_step = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            for i in range(5):
                stage_state[i] = x[i] + stage_step * slope[i] if stage > 0 else x[i]
            _slopes(
                stage_state,
                0.5 * (duct[early] + duct[late]),
                inputs,
                rps[a],
                is_yaw,
                inverse,
                model,
                slope,
            )
            weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
            for i in range(5):
                total[i] += weight * slope[i]
        for i in range(5):
            x[i] += total[i]
        track[row] = x
    return track


@kernel
def slopes_along(
    track: Array,
    duct: Array,
    rps: Array,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    coupling: Array,
) -> Array:
    """Return the state derivatives at every row of ``track``.

    ``duct`` (rad), ``rps`` (rev/s) and ``coupling`` have the same number of rows.
    """
    out = np.empty_like(track)
    for row in range(len(track)):
        _slopes(track[row], duct[row], coupling[row], rps[row], is_yaw, inverse, model, out[row])
    return out


_IN_PLANE: dict[Plane, list[int]] = {"yaw": [0, 1, 5], "pitch": [0, 2, 4]}
"""Indices into nu of the velocities in a plane."""


def constraint(model: VehicleModel, plane: Plane) -> Array:
    """Return M_p^-1, shape (3, 3): from forces in the plane to accelerations."""
    rows = _IN_PLANE[plane]
    return np.ascontiguousarray(np.linalg.inv(model.inertia.M[np.ix_(rows, rows)]))


def accelerations(
    model: VehicleModel, plane: Plane, state: Array, duct_rad: float, rps: float
) -> Array:
    """Return (u', v' or w', rate') at the state (u, v|w, rate, angle, z), paper's axes."""
    out = np.empty(5)
    _slopes(
        state,
        duct_rad,
        np.zeros(N_COUPLING),
        rps,
        plane == "yaw",
        constraint(model, plane),
        model,
        out,
    )
    return out[:3]


def initial_motion(run: Run) -> InitialMotion:
    """Return the measured initial motion of a run; rates are averaged over SETTLING_S."""
    settling_samples = max(2, int(SETTLING_S * RATE_HZ))
    slope = float(
        np.polyfit(run.time_s[: 2 * settling_samples], run.depth_m[: 2 * settling_samples], 1)[0]
    )
    angle = run.heading_rad if run.plane == "yaw" else run.pitch_rad
    return InitialMotion(
        rate_radps=float(np.mean(run.rate_radps[:settling_samples])),
        angle_rad=float(angle[0]),
        depth_m=float(run.depth_m[0]),
        depth_rate_mps=slope,
    )


def first_state(run: Run, start: InitialMotion, speed_mps: float) -> Array:
    """Return the state (u, v|w, rate, angle, z) at the run's first sample, paper's axes."""
    # Pitch: heave follows from depth' = w cos(theta) - U sin(theta) in FRD.
    if run.plane == "yaw":
        return np.array([speed_mps, 0.0, -start.rate_radps, -start.angle_rad, SUBMERGED_Z_M])
    theta = start.angle_rad
    w_frd = (start.depth_rate_mps + speed_mps * math.sin(theta)) / math.cos(theta)
    return np.array([speed_mps, -w_frd, -start.rate_radps, -theta, SUBMERGED_Z_M])


def heave_coupling(run: Run, speed_mps: float) -> Array | None:
    """Return the cross-plane inputs (samples, N_COUPLING) of a yaw test; None for a pitch test.

    A vehicle that is not neutrally buoyant keeps depth with a pitch angle and a heave velocity. The
    crossflow drag is quadratic in the total crossflow, so heave also damps sway. A pitch test needs
    no inputs: the heading loop keeps the vehicle straight, and sway is not measured.
    """
    # Heave from pitch and depth (FRD): depth' = w cos(theta) - U sin(theta).
    if run.plane == "pitch":
        return None
    window = min(SMOOTHING, (run.time_s.size - 1) // 2 * 2 + 1)
    pitch, q, roll = (
        savgol_filter(x, window, 1) for x in (run.pitch_rad, run.q_radps, run.roll_rad)
    )
    sinking = savgol_filter(run.depth_m, window, 1, deriv=1, delta=1.0 / RATE_HZ)
    heave = (sinking + speed_mps * np.sin(pitch)) / np.cos(pitch)
    return np.column_stack([-heave, -q, -pitch, 0.0 * q, roll, 0.0 * q])


def simulate(
    model: VehicleModel,
    actuator: Actuator,
    run: Run,
    start: InitialMotion,
    stride: int,
    speed_mps: float,
    coupling: Array | None = None,
) -> PlaneTrajectory:
    """Simulate a run from ``start`` under the commands of the run.

    One integration step covers ``stride`` samples: 1 for plots (20 ms), 5 for fitting (0.1 s).
    ``coupling`` holds the cross-plane inputs; the default is ``heave_coupling``, for a test with
    the loop of the other plane closed.
    """
    coupling = heave_coupling(run, speed_mps) if coupling is None else coupling
    x0 = first_state(run, start, speed_mps)
    angles = duct_along(run, run.plane, actuator)
    rps, inverse = run.thrust * propeller.rps(1.0, model), constraint(model, run.plane)
    track = integrate(
        x0, angles, rps, stride, 1.0 / RATE_HZ, run.plane == "yaw", inverse, model, coupling
    )
    return to_mavlink_axes(track, start)


def to_mavlink_axes(track: Array, start: InitialMotion) -> PlaneTrajectory:
    """Return a track of states in MAVLink's axes, with depth relative to the start of the run."""
    return PlaneTrajectory(
        rate_radps=-track[:, 2],
        angle_rad=-track[:, 3],
        depth_m=start.depth_m - (track[:, 4] - SUBMERGED_Z_M),
        speed_mps=track[:, 0],
    )
