"""A plane under the autopilot's loop, small motion: what a test that is added to the loop's output
does.

The linear plane with the tailcone's lag and delay, the loop's laws of
``sysid.control_analysis.loop_transfer`` at the autopilot's tick, and the noise model's sea. An
excursion that stays within limits is small enough for that; what a test tells is then judged by the
nonlinear plane under the command that comes of it (``information``)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sitl.vehicle.jit import entry_point
from sysid.control_analysis.loop_transfer import SAMPLING_S, Gains
from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.map import fit
from sysid.models import noise
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle

Array = NDArray[np.float64]

DT = 1.0 / RATE_HZ


class Loop(NamedTuple):
    """One plane, its lag, the sea, and the law that holds it; x: plane, sea, angle and rate of the
    surface."""

    transition: Array
    drive: Array
    """Of a command held for a tick."""
    feedback: Array
    """Command per x."""
    integral: Array
    """Growth of the integrator's command in a tick per x."""
    late: int
    """Ticks of delay."""
    kick: Array
    """(n, n): root of the sea's covariance in a tick."""
    spread: Array
    """Standard deviation of x before the loops have held her."""


def of_vehicle(vehicle: CandidateVehicle, plane: Plane, gains: Gains, level: Noise) -> Loop:
    linear, actuator = fit.linear_plane(vehicle, plane), vehicle.actuators[plane]
    sea, density, _, _, P0 = noise.system(linear, level)
    n, m = linear.A.shape[0], sea.shape[0]
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    A, B, D = np.zeros((m + 2, m + 2)), np.zeros(m + 2), np.zeros((m + 2, m + 2))
    A[:m, :m], A[:n, m] = sea, linear.B
    A[m, m + 1], A[m + 1, m], A[m + 1, m + 1] = 1.0, -(wn**2), -2.0 * zeta * wn
    B[m + 1] = wn**2
    D[:m, :m] = density
    transition, process = noise.discrete(A, D, DT)
    held = expm(np.block([[A, B[:, None]], [np.zeros((1, m + 3))]]) * DT)[: m + 2, m + 2]
    spread = np.zeros(m + 2)
    spread[:m] = np.sqrt(np.diag(P0))
    feedback, integral = _feedback_rows(plane, linear.A, gains, m + 2)
    late = round((actuator.delay_s + SAMPLING_S) / DT)
    return Loop(transition, held, feedback, integral, late, noise.root(process), spread)


def _feedback_rows(plane: Plane, A: Array, gains: Gains, size: int) -> tuple[Array, Array]:
    """Rows of the command and of its integrator's growth in a tick; a pitch integrator is left
    out."""
    feedback, integral = np.zeros(size), np.zeros(size)
    if plane == "yaw":
        feedback[1], feedback[2] = -gains["HDG_D"], -gains["HDG_P"]
        integral[2] = -gains["HDG_I"] * DT
        return feedback, integral
    wanted = np.zeros(size)
    wanted[3] = gains["DPT_P"]
    wanted[: A.shape[0]] += gains["DPT_D"] * A[3]
    feedback += gains["PTCH_P"] * wanted
    feedback[1] -= gains["PTCH_D"]
    feedback[2] -= gains["PTCH_P"]
    integral[3] = gains["PTCH_P"] * gains["DPT_I"] * DT
    return feedback, integral


class ClosedLoopResponse(NamedTuple):
    """On the 50 Hz grid."""

    motion: Array
    """(ticks, 3): rate, angle and depth."""
    command_rad: Array
    """The test and the loop's answer, from trim."""


def simulate(
    loop: Loop, plane: Plane, signal_rad: Array, kicks: Array | None = None
) -> ClosedLoopResponse:
    """A test that is added to the loop's command; ``kicks``, (ticks, n) of unit variance, are the
    sea's."""
    n = loop.feedback.size
    quiet = kicks is None
    draws = np.zeros((signal_rad.size, n)) if kicks is None else kicks @ loop.kick.T
    first = np.zeros(n) if quiet or kicks is None else loop.spread * kicks[0]
    track, command = _simulate(*loop[:5], signal_rad, draws, first)
    rows = 2 if plane == "yaw" else 3
    motion = np.zeros((signal_rad.size, 3))
    motion[:, :rows] = track[:, 1 : 1 + rows]
    return ClosedLoopResponse(motion, command)


@entry_point
def _simulate(
    transition: Array,
    drive: Array,
    feedback: Array,
    integral: Array,
    late: int,
    signal: Array,
    draws: Array,
    first: Array,
) -> tuple[Array, Array]:
    ticks, n = draws.shape
    track, command = np.empty((ticks, n)), np.empty(ticks)
    x, after, memory = first.copy(), np.empty(n), 0.0
    for k in range(ticks):
        track[k] = x
        asked = signal[k] + memory
        for j in range(n):
            asked += feedback[j] * x[j]
            memory += integral[j] * x[j]
        command[k] = asked
        acting = command[k - late] if k >= late else 0.0
        for i in range(n):
            after[i] = drive[i] * acting + draws[k, i]
            for j in range(n):
                after[i] += transition[i, j] * x[j]
        x[:] = after
    return track, command
