"""Small-signal simulation of a plane under the autopilot's loop with a test added to its command.

The model is the linear plane with lag and delay of the tailcone, the control law of
``sysid.control_analysis.loop_transfer`` at the autopilot's tick, and the disturbance of the noise
model. Motion within the safety limits is small enough for it. The information of a test is computed
with the nonlinear plane under the resulting command (``information``).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from mavlink_io.jit import entry_point
from sysid.control_analysis.loop_transfer import SAMPLING_S, Gains
from sysid.data.runs import RATE_HZ
from sysid.estimation.map import steady_state
from sysid.models import noise
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

DT = 1.0 / RATE_HZ
"""Sample interval (s)."""


class Loop(NamedTuple):
    """Discrete-time loop of one plane.

    x[k+1] = transition x[k] + drive u[k - delay_ticks] + kick w[k] with w standard normal. States
    x: plane, disturbance, angle and rate of the surface.
    """

    transition: Array
    drive: Array
    """Response to a command that is constant over a tick."""
    feedback: Array
    """Command per state."""
    integral: Array
    """Increase of the integrator's command per tick and state."""
    delay_ticks: int
    """Delay of tailcone and sampling in ticks."""
    kick: Array
    """Square root of the covariance of the process noise per tick, (n, n)."""
    spread: Array
    """Standard deviation of the initial state."""


def of_vehicle(vehicle: CandidateVehicle, plane: Plane, gains: Gains, level: Noise) -> Loop:
    """Return the loop of one plane of a vehicle.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    plane : str
        yaw or pitch.
    gains : Gains
        Gains by name; a pitch integrator is ignored.
    level : Noise
        Disturbance model.

    Returns
    -------
    Loop
        At the autopilot's tick; the transition is the matrix exponential over `DT`.
    """
    linear, actuator = steady_state.linear_plane(vehicle, plane), vehicle.actuators[plane]
    disturbance, density, _, _, P0 = noise.system(linear, level)
    n, m = linear.A.shape[0], disturbance.shape[0]
    wn_radps, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    A, B, D = np.zeros((m + 2, m + 2)), np.zeros(m + 2), np.zeros((m + 2, m + 2))
    A[:m, :m], A[:n, m] = disturbance, linear.B
    A[m, m + 1], A[m + 1, m], A[m + 1, m + 1] = 1.0, -(wn_radps**2), -2.0 * zeta * wn_radps
    B[m + 1] = wn_radps**2
    D[:m, :m] = density
    transition, process = noise.discrete(A, D, DT)
    held_input = expm(np.block([[A, B[:, None]], [np.zeros((1, m + 3))]]) * DT)[: m + 2, m + 2]
    spread = np.zeros(m + 2)
    spread[:m] = np.sqrt(np.diag(P0))
    feedback, integral = _feedback_rows(plane, linear.A, gains, m + 2)
    delay_ticks = round((actuator.delay_s + SAMPLING_S) / DT)
    return Loop(
        transition=transition,
        drive=held_input,
        feedback=feedback,
        integral=integral,
        delay_ticks=delay_ticks,
        kick=noise.root(process),
        spread=spread,
    )


def _feedback_rows(plane: Plane, A: Array, gains: Gains, size: int) -> tuple[Array, Array]:
    """Return the feedback row and the integrator row; a pitch integrator is ignored."""
    feedback, integral = np.zeros(size), np.zeros(size)
    if PLANES[plane].is_yaw:
        feedback[1], feedback[2] = -gains["HDG_D"], -gains["HDG_P"]
        integral[2] = -gains["HDG_I"] * DT
        return feedback, integral
    pitch_command = np.zeros(size)
    pitch_command[3] = gains["DPT_P"]
    pitch_command[: A.shape[0]] += gains["DPT_D"] * A[3]
    feedback += gains["PTCH_P"] * pitch_command
    feedback[1] -= gains["PTCH_D"]
    feedback[2] -= gains["PTCH_P"]
    integral[3] = gains["PTCH_P"] * gains["DPT_I"] * DT
    return feedback, integral


class ClosedLoopResponse(NamedTuple):
    """Response on the 50 Hz grid."""

    motion: Array
    """Rate (rad/s), angle (rad) and depth (m), (ticks, 3)."""
    command_rad: Array
    """Test plus feedback, relative to trim."""


def simulate(
    loop: Loop, plane: Plane, signal_rad: Array, kicks: Array | None = None
) -> ClosedLoopResponse:
    """Simulate a test that is added to the loop's command.

    Parameters
    ----------
    loop : Loop
        Loop of the plane.
    plane : str
        yaw or pitch.
    signal_rad : ndarray
        Test signal at every tick (rad).
    kicks : ndarray, optional
        Standard normal draws of the disturbance, (ticks, n); no disturbance without them.

    Returns
    -------
    ClosedLoopResponse
        Motion and command.
    """
    n = loop.feedback.size
    calm = kicks is None
    draws = np.zeros((signal_rad.size, n)) if kicks is None else kicks @ loop.kick.T
    initial = np.zeros(n) if calm or kicks is None else loop.spread * kicks[0]
    states, command = _simulate(*loop[:5], signal_rad, draws, initial)
    rows = PLANES[plane].n_outputs
    motion = np.zeros((signal_rad.size, 3))
    motion[:, :rows] = states[:, 1 : 1 + rows]
    return ClosedLoopResponse(motion, command)


@entry_point
def _simulate(
    transition: Array,
    drive: Array,
    feedback: Array,
    integral: Array,
    delay_ticks: int,
    signal: Array,
    draws: Array,
    initial: Array,
) -> tuple[Array, Array]:
    """Run the recursion tick by tick; returns states (ticks, n) and commands (ticks,).

    With i the command of the integrator (rad)::

        u[k]   = signal[k] + i[k] + feedback x[k]
        i[k+1] = i[k] + integral x[k]
        x[k+1] = transition x[k] + drive u[k - delay_ticks] + draws[k]
    """
    ticks, n = draws.shape
    states, command = np.empty((ticks, n)), np.empty(ticks)
    x, next_x, integral_rad = initial.copy(), np.empty(n), 0.0
    for k in range(ticks):
        states[k] = x
        command_rad = signal[k] + integral_rad
        for j in range(n):
            command_rad += feedback[j] * x[j]
            integral_rad += integral[j] * x[j]
        command[k] = command_rad
        delayed_rad = command[k - delay_ticks] if k >= delay_ticks else 0.0
        for i in range(n):
            next_x[i] = drive[i] * delayed_rad + draws[k, i]
            for j in range(n):
                next_x[i] += transition[i, j] * x[j]
        x[:] = next_x
    return states, command
