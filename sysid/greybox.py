"""One plane of the simulator's own physics, driven by logged commands: the model that identification fits.

Forces come from ``sitl.vehicle``; only the motion is confined to a plane. That leaves five states in pitch and four
in yaw, and lets a run be simulated without the other plane's drift. Inside: the paper's axes. Outside: MAVLink's.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import dynamics, propeller
from sitl.vehicle.kernel import kernel
from sitl.vehicle.model import Model
from sitl.vehicle.water import STILL
from sysid.runs import RATE_HZ, Plane, Run

Array = NDArray[np.float64]

SUBMERGED_Z_M = -50.0
"""Where the plane model flies: far from a surface that no test may touch."""
SETTLING_S = 0.5
"""Start of a run over which measured starting values are averaged."""


class Actuator(NamedTuple):
    """Tailcone axis as identified: command -> travel -> delay -> second-order lag -> rate limit -> stops; and bias."""

    delay_s: float
    natural_frequency_radps: float
    damping_ratio: float
    bias_rad: float
    travel_rad: float
    rate_radps: float


class Start(NamedTuple):
    """Measured motion at the first sample, in MAVLink's axes."""

    rate_radps: float
    angle_rad: float
    depth_m: float
    depth_rate_mps: float


class Motion(NamedTuple):
    """Simulated run, MAVLink's axes, one row for every ``stride`` samples of the run's grid."""

    rate_radps: Array
    angle_rad: Array
    depth_m: Array
    speed_mps: Array


@kernel
def duct_angles(command: Array, actuator: Actuator, dt: float) -> Array:
    """True duct angle at every sample of a command held between samples; the exact lag, rate limited."""
    n = command.size
    angles = np.empty(n)
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    damped = wn * math.sqrt(1.0 - zeta * zeta)
    decay = math.exp(-zeta * wn * dt)
    c, s = decay * math.cos(damped * dt), decay * math.sin(damped * dt) / damped
    late = actuator.delay_s / dt
    whole = int(late)
    part = late - whole
    angle, rate = command[0], 0.0
    for k in range(n):
        angles[k] = angle + actuator.bias_rad
        newer = min(max(command[max(0, k - whole)], -actuator.travel_rad), actuator.travel_rad)
        older = min(max(command[max(0, k - whole - 1)], -actuator.travel_rad), actuator.travel_rad)
        # A command edge inside the interval: the lag sees the mean, exact to second order in dt.
        target = newer + part * (older - newer)
        error = angle - target
        free = target + (c + zeta * wn * s) * error + s * rate
        rate = -wn * wn * s * error + (c - zeta * wn * s) * rate
        reach = actuator.rate_radps * dt
        angle += min(max(free - angle, -reach), reach)
        rate = min(max(rate, -actuator.rate_radps), actuator.rate_radps)
        if abs(angle) > actuator.travel_rad:
            angle, rate = math.copysign(actuator.travel_rad, angle), 0.0
    return angles


@kernel
def _slopes(
    x: Array, duct_rad: float, rps: float, is_yaw: bool, constrain: Array, model: Model, state: Array, zero: Array,
    full: Array, out: Array,
) -> None:  # fmt: skip
    """Derivative of (u, v, r, psi, -) or (u, w, q, theta, z), paper's axes, the other plane held at rest."""
    state[:] = 0.0
    state[7] = x[0]
    if is_yaw:
        state[2] = SUBMERGED_Z_M
        state[3] = 1.0
        state[8], state[12] = x[1], x[2]
        dynamics.derivative(state, duct_rad, 0.0, rps, zero[:6], STILL, model, full)
    else:
        state[2] = x[4]
        state[3], state[5] = math.cos(0.5 * x[3]), math.sin(0.5 * x[3])
        state[9], state[11] = x[1], x[2]
        dynamics.derivative(state, 0.0, duct_rad, rps, zero[:6], STILL, model, full)
    for i in range(3):
        total = 0.0
        for j in range(6):
            total += constrain[i, j] * full[7 + j]
        out[i] = total
    out[3] = x[2]
    out[4] = 0.0 if is_yaw else full[2]


@kernel
def integrate(
    x0: Array, duct: Array, rps: Array, stride: int, dt: float, is_yaw: bool, constrain: Array, model: Model
) -> Array:
    """Classical Runge-Kutta over ``stride`` samples a step; rows (u, v|w, rate, angle, z)."""
    rows = (duct.size - 1) // stride + 1
    track = np.empty((rows, 5))
    state, full, zero, between = np.empty(13), np.empty(13), np.zeros(13), np.empty(5)
    k1, k2, k3, k4 = np.empty(5), np.empty(5), np.empty(5), np.empty(5)
    x = x0.copy()
    track[0] = x
    h = dt * stride
    for row in range(1, rows):
        a, b = (row - 1) * stride, row * stride
        middle = 0.5 * (duct[a + stride // 2] + duct[a + (stride + 1) // 2])
        n = rps[a]
        _slopes(x, duct[a], n, is_yaw, constrain, model, state, zero, full, k1)
        for i in range(5):
            between[i] = x[i] + 0.5 * h * k1[i]
        _slopes(between, middle, n, is_yaw, constrain, model, state, zero, full, k2)
        for i in range(5):
            between[i] = x[i] + 0.5 * h * k2[i]
        _slopes(between, middle, n, is_yaw, constrain, model, state, zero, full, k3)
        for i in range(5):
            between[i] = x[i] + h * k3[i]
        _slopes(between, duct[b], n, is_yaw, constrain, model, state, zero, full, k4)
        for i in range(5):
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        track[row] = x
    return track


_IN_PLANE: dict[Plane, list[int]] = {"yaw": [0, 1, 5], "pitch": [0, 2, 4]}


def constraint(model: Model, plane: Plane) -> Array:
    """Matrix (3, 6) from free to confined accelerations: forces of the plane over the plane's own mass matrix."""
    rows = _IN_PLANE[plane]
    M = model.inertia.M
    return np.ascontiguousarray(np.linalg.solve(M[np.ix_(rows, rows)], M[rows, :]))


def accelerations(model: Model, plane: Plane, state: Array, duct_rad: float, rps: float) -> Array:
    """(u', v' or w', rate') at one plane state (u, v|w, rate, angle, z), paper's axes."""
    out = np.empty(5)
    work = np.empty(13), np.zeros(13), np.empty(13)
    _slopes(state, duct_rad, rps, plane == "yaw", constraint(model, plane), model, *work, out)
    return out[:3]


def measured_start(run: Run) -> Start:
    """Starting values of a run, averaged over its first moments."""
    few = max(2, int(SETTLING_S * RATE_HZ))
    slope = float(np.polyfit(run.time_s[: 2 * few], run.depth_m[: 2 * few], 1)[0])
    angle = run.heading_rad if run.plane == "yaw" else run.pitch_rad
    return Start(float(np.mean(run.rate_radps[:few])), float(angle[0]), float(run.depth_m[0]), slope)


def simulate(model: Model, actuator: Actuator, run: Run, start: Start, stride: int, speed_mps: float) -> Motion:
    """The run as the model would have flown it from ``start`` under the run's own commands.

    ``stride`` samples make one integration step: 1 for plots (20 ms), 5 for fitting (0.1 s).
    """
    is_yaw = run.plane == "yaw"
    if is_yaw:
        x0 = np.array([speed_mps, 0.0, -start.rate_radps, -start.angle_rad, 0.0])
    else:
        theta = start.angle_rad
        w_frd = (start.depth_rate_mps + speed_mps * math.sin(theta)) / math.cos(theta)
        x0 = np.array([speed_mps, -w_frd, -start.rate_radps, -theta, SUBMERGED_Z_M])
    duct = duct_angles(run.command_rad, actuator, 1.0 / RATE_HZ)
    rps = run.thrust * propeller.rps(1.0, model)
    track = integrate(x0, duct, rps, stride, 1.0 / RATE_HZ, is_yaw, constraint(model, run.plane), model)
    return Motion(-track[:, 2], -track[:, 3], start.depth_m - (track[:, 4] - x0[4]), track[:, 0])
