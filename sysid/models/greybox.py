"""One plane of the simulator's own physics, driven by logged commands: the model that
identification fits.

Forces come from ``sitl.vehicle``; only the motion is confined to a plane. That leaves five states
in pitch and four in yaw, and lets a run be simulated without the other plane's drift. Inside: the
paper's axes. Outside: MAVLink's."""

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
"""Where the plane model flies: far from a surface that no test may touch."""
N_COUPLING = 6
"""Columns of a run's surroundings: what the rest of the vehicle does meanwhile."""
SMOOTHING = 101
"""Samples over which the other plane's motion is averaged: two seconds, in which a loop that is on
changes little."""
SETTLING_S = 0.5
"""Start of a run over which measured starting values are averaged."""


class Actuator(NamedTuple):
    """Tailcone axis as identified: command, travel, delay, second-order lag, rate limit, stops,
    play; and bias."""

    delay_s: float
    natural_frequency_radps: float
    damping_ratio: float
    bias_rad: float
    travel_rad: float
    rate_radps: float
    backlash_rad: float = 0.0
    """Play between motor and duct, from flank to flank."""


class InitialMotion(NamedTuple):
    """Measured motion at the first sample, in MAVLink's axes."""

    rate_radps: float
    angle_rad: float
    depth_m: float
    depth_rate_mps: float


class PlaneTrajectory(NamedTuple):
    """Simulated run, MAVLink's axes, one row for every ``stride`` samples of the run's grid."""

    rate_radps: Array
    angle_rad: Array
    depth_m: Array
    speed_mps: Array


@kernel
def duct_angles(command: Array, actuator: Actuator, dt: float) -> Array:
    """True duct angle at every sample of a command held between samples; the exact lag, rate
    limited."""
    n = command.size
    angles = np.empty(n)
    c, s = lag_coefficients(actuator, dt)
    late = actuator.delay_s / dt
    whole = int(late)
    part = late - whole
    angle, rate = command[0], 0.0
    turned, slack = angle, 0.5 * actuator.backlash_rad
    for k in range(n):
        turned = min(max(turned, angle - slack), angle + slack)
        angles[k] = turned + actuator.bias_rad
        newer = min(max(command[max(0, k - whole)], -actuator.travel_rad), actuator.travel_rad)
        older = min(max(command[max(0, k - whole - 1)], -actuator.travel_rad), actuator.travel_rad)
        # A command edge inside the interval: the lag sees the mean, exact to second order in dt.
        angle, rate = step_actuator(actuator, angle, rate, newer + part * (older - newer), c, s, dt)
    return angles


@kernel
def lag_coefficients(actuator: Actuator, dt: float) -> tuple[float, float]:
    """e^(-zeta wn dt) cos(wd dt) and e^(-zeta wn dt) sin(wd dt) / wd of a tailcone's lag."""
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    damped = wn * math.sqrt(1.0 - zeta * zeta)
    decay = math.exp(-zeta * wn * dt)
    return decay * math.cos(damped * dt), decay * math.sin(damped * dt) / damped


@kernel
def step_actuator(
    actuator: Actuator, angle: float, rate: float, target: float, c: float, s: float, dt: float
) -> tuple[float, float]:
    """The motor's angle and rate after ``dt`` towards a target that stands still; ``c`` and ``s``
    are its ``lag_coefficients``.

    The exact lag, within the rate limit and between the stops.
    """
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    error = angle - target
    free = target + (c + zeta * wn * s) * error + s * rate
    rate = -wn * wn * s * error + (c - zeta * wn * s) * rate
    reach = actuator.rate_radps * dt
    angle += min(max(free - angle, -reach), reach)
    rate = min(max(rate, -actuator.rate_radps), actuator.rate_radps)
    if abs(angle) > actuator.travel_rad:
        angle, rate = math.copysign(actuator.travel_rad, angle), 0.0
    return angle, rate


def duct_along(run: Run, surface: Plane, actuator: Actuator) -> Array:
    """True angle of a plane's surface at every sample of a run, (samples,)."""
    return duct_angles(run.history_rad(surface), actuator, 1.0 / RATE_HZ)[-run.time_s.size :]


@kernel
def _slopes(
    x: Array,
    duct_rad: float,
    around: Array,
    rps: float,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    out: Array,
) -> None:
    """Derivative of (u, v, r, psi, -) or (u, w, q, theta, z), paper's axes, in deep and still
    water.

    ``around`` is what the rest of the vehicle does meanwhile: the other plane's cross speed, rate
    and pitch (0 where pitch is a state), roll rate, roll, and the other surface's angle."""
    u, p, roll = x[0], around[3], around[4]
    if is_yaw:
        v, r, w, q, theta, rudder, elevator = (
            x[1],
            x[2],
            around[0],
            around[1],
            around[2],
            duct_rad,
            around[5],
        )
    else:
        w, q, v, r, theta, rudder, elevator = (
            x[1],
            x[2],
            around[0],
            around[1],
            x[3],
            around[5],
            duct_rad,
        )
    level = math.cos(theta)
    up = (-math.sin(theta), math.sin(roll) * level, math.cos(roll) * level)
    nu = (u, v, w, p, q, r)
    axis = duct.ring_axis(model.duct.vectored * rudder, model.duct.vectored * elevator)
    turning = dynamics.coriolis(nu, model.inertia)
    static = restoring.wrench(SUBMERGED_Z_M, up[0], up, 1.0, model.hydrostatics, model.stations)
    across = hydrodynamics.crossflow_drag(v, w, q, r, model.stations)
    hull = hydrodynamics.lift_and_drag(u, v, w, p, q, r, model.hull)
    tail = dynamics.tail(nu, axis, rudder, elevator, rps, 1.0, model)
    turned = hydrodynamics.duct_interaction(u * abs(u), rudder, elevator, model.hull)
    X = turning[0] + static[0] + across[0] + hull[0] + tail[0] + turned[0]
    if is_yaw:
        side = turning[1] + static[1] + across[1] + hull[1] + tail[1] + turned[1]
        moment = turning[5] + static[5] + across[5] + hull[5] + tail[5] + turned[5]
        out[3] = (q * math.sin(roll) + r * math.cos(roll)) / level
        out[4] = 0.0
    else:
        side = turning[2] + static[2] + across[2] + hull[2] + tail[2] + turned[2]
        moment = turning[4] + static[4] + across[4] + hull[4] + tail[4] + turned[4]
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
    around: Array | None = None,
) -> Array:
    """Classical Runge-Kutta over ``stride`` samples a step; rows (u, v|w, rate, angle, z).

    ``inverse`` is the plane's ``constraint``, ``around`` a run's ``surroundings``; without them
    there are none."""
    rows = (duct.size - 1) // stride + 1
    track = np.empty((rows, 5))
    slope, between, total = np.empty(5), np.empty(5), np.empty(5)
    near, x = np.zeros(N_COUPLING), x0.copy()
    track[0] = x
    h = dt * stride
    for row in range(1, rows):
        a = (row - 1) * stride
        total[:] = 0.0
        for stage in range(4):
            early = a + stride // 2 if 0 < stage < 3 else a + stride * (stage == 3)
            late = a + (stride + 1) // 2 if 0 < stage < 3 else early
            if around is not None:
                for i in range(N_COUPLING):
                    near[i] = 0.5 * (around[early, i] + around[late, i])
            reach = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            for i in range(5):
                between[i] = x[i] + reach * slope[i] if stage > 0 else x[i]
            _slopes(
                between,
                0.5 * (duct[early] + duct[late]),
                near,
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
    around: Array,
) -> Array:
    """Derivatives of the states at every row of ``track``, whose duct angles, shaft speeds and
    surroundings match."""
    out = np.empty_like(track)
    for row in range(len(track)):
        _slopes(track[row], duct[row], around[row], rps[row], is_yaw, inverse, model, out[row])
    return out


_IN_PLANE: dict[Plane, list[int]] = {"yaw": [0, 1, 5], "pitch": [0, 2, 4]}


def constraint(model: VehicleModel, plane: Plane) -> Array:
    """(3, 3) from forces in the plane to accelerations: the inverse of the plane's own mass
    matrix."""
    rows = _IN_PLANE[plane]
    return np.ascontiguousarray(np.linalg.inv(model.inertia.M[np.ix_(rows, rows)]))


def accelerations(
    model: VehicleModel, plane: Plane, state: Array, duct_rad: float, rps: float
) -> Array:
    """(u', v' or w', rate') at one plane state (u, v|w, rate, angle, z), paper's axes."""
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
    """Starting values of a run, averaged over its first moments."""
    few = max(2, int(SETTLING_S * RATE_HZ))
    slope = float(np.polyfit(run.time_s[: 2 * few], run.depth_m[: 2 * few], 1)[0])
    angle = run.heading_rad if run.plane == "yaw" else run.pitch_rad
    return InitialMotion(
        float(np.mean(run.rate_radps[:few])), float(angle[0]), float(run.depth_m[0]), slope
    )


def first_state(run: Run, start: InitialMotion, speed_mps: float) -> Array:
    """(u, v|w, rate, angle, z) of the run's first sample, the paper's axes."""
    if run.plane == "yaw":
        return np.array([speed_mps, 0.0, -start.rate_radps, -start.angle_rad, SUBMERGED_Z_M])
    theta = start.angle_rad
    w_frd = (start.depth_rate_mps + speed_mps * math.sin(theta)) / math.cos(theta)
    return np.array([speed_mps, -w_frd, -start.rate_radps, -theta, SUBMERGED_Z_M])


def heave_coupling(run: Run, speed_mps: float) -> Array | None:
    """Surroundings (samples, AROUND) of a yaw test: how the vehicle pitched meanwhile, and slipped
    through the water.

    A vehicle that is not neutral flies level with her nose up or down; the drag across her hull,
    which grows with the square of what flows there, then holds sway as well. Heave follows from
    pitch and depth: depth' = w - U sin(theta). Pitch tests have none: her loops keep the vehicle
    straight, and nothing measures sway."""
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
    around: Array | None = None,
) -> PlaneTrajectory:
    """The run as the model would have flown it from ``start`` under the run's own commands.

    ``stride`` samples make one integration step: 1 for plots (20 ms), 5 for fitting (0.1 s).
    ``around`` are the run's surroundings, by default those of a plane whose loop stayed on."""
    around = heave_coupling(run, speed_mps) if around is None else around
    x0 = first_state(run, start, speed_mps)
    angles = duct_along(run, run.plane, actuator)
    rps, inverse = run.thrust * propeller.rps(1.0, model), constraint(model, run.plane)
    track = integrate(
        x0, angles, rps, stride, 1.0 / RATE_HZ, run.plane == "yaw", inverse, model, around
    )
    return to_mavlink_axes(track, start)


def to_mavlink_axes(track: Array, start: InitialMotion) -> PlaneTrajectory:
    """A track of states in MAVLink's axes, its depth counted from where the run began."""
    return PlaneTrajectory(
        -track[:, 2], -track[:, 3], start.depth_m - (track[:, 4] - SUBMERGED_Z_M), track[:, 0]
    )
