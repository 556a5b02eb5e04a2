"""Simulated steps of the autopilot's own loops around a linear plane, with all limits.

Linear analysis does not cover travel, rate limit and integrator hold, which determine the response
to a large step. The control law is the autopilot's (``autopilot.control.loops``) itself. Sensors
are perfect and there is no disturbance.
"""

import math
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from autopilot.control import loops, params
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import LoopMemory, VehicleEstimate
from sysid.control_analysis.loop_transfer import SAMPLING_S, TICK_S, Lag
from sysid.design.design_model import DesignModel
from sysid.design.specification import Spec
from sysid.models.linear_planes import LinearPlane

Array = NDArray[np.float64]


class StepResponse(NamedTuple):
    """Response to one change of set-point, one entry per tick."""

    time_s: Array
    value: Array
    """Change of heading (rad) or depth (m) from the start."""
    command_rad: Array
    """Surface command, relative to its trim."""


def heading_step(
    vehicle: DesignModel, values: Mapping[str, float], step_rad: float, seconds: float, spec: Spec
) -> StepResponse:
    """Return the response to a change of the heading set-point.

    Parameters
    ----------
    vehicle : DesignModel
        Linear vehicle.
    values : Mapping
        Parameters by name; the rudder starts at its trim, so a bias reduces the travel.
    step_rad : float
        Change of heading (rad), positive to starboard.
    seconds : float
        Length of the simulation (s).
    spec : Spec
        Rate limit of the tailcone.

    Returns
    -------
    StepResponse
        Heading and rudder.
    """
    config = params.config(values)
    states, commands, memory = [], [], LoopMemory()
    plant = _PlaneWithTailcone(vehicle.planes.yaw, vehicle.yaw_lag, spec)
    for _ in range(round(seconds / TICK_S)):
        _, r, psi = plant.state
        estimate = VehicleEstimate(
            heading_rad=float(psi), r_radps=float(r), speed_mps=config.cruise_speed_mps
        )
        output, memory = loops.step_loops(
            estimate,
            Setpoint(heading_rad=step_rad),
            memory,
            config,
            TICK_S,
            heading=True,
            depth=False,
        )
        command = output.rudder_rad - config.rudder_trim_rad
        plant.advance(command)
        states.append(plant.state[2])
        commands.append(command)
    return _step_response(states, commands)


def depth_step(
    vehicle: DesignModel,
    values: Mapping[str, float],
    step_m: float,
    seconds: float,
    spec: Spec,
    level_pitch_rad: float,
) -> StepResponse:
    """Return the response to a change of the depth set-point from level flight.

    Parameters
    ----------
    vehicle : DesignModel
        Linear vehicle.
    values : Mapping
        Parameters by name.
    step_m : float
        Change of depth (m), positive down.
    seconds : float
        Length of the simulation (s).
    spec : Spec
        Rate limit of the tailcone.
    level_pitch_rad : float
        Pitch of level flight (rad), which the depth integrator has at the start.

    Returns
    -------
    StepResponse
        Depth and elevator.
    """
    config = params.config(values)
    load_rad = config.level_pitch_rad - level_pitch_rad
    initial_integral_rad = min(config.depth_i_max, max(-config.depth_i_max, load_rad))
    states, commands, memory = [], [], LoopMemory(depth_integral_rad=initial_integral_rad)
    plant = _PlaneWithTailcone(vehicle.planes.pitch, vehicle.pitch_lag, spec)
    for _ in range(round(seconds / TICK_S)):
        _, q, theta, depth = plant.state
        estimate = VehicleEstimate(
            pitch_rad=float(theta) + level_pitch_rad,
            q_radps=float(q),
            depth_m=float(depth),
            depth_rate_mps=float(vehicle.planes.pitch.A[3] @ plant.state),
            speed_mps=config.cruise_speed_mps,
        )
        output, memory = loops.step_loops(
            estimate, Setpoint(depth_m=step_m), memory, config, TICK_S, heading=False, depth=True
        )
        command = output.elevator_rad - config.elevator_trim_rad
        plant.advance(command)
        states.append(plant.state[3])
        commands.append(command)
    return _step_response(states, commands)


def _step_response(values: list[float], commands: list[float]) -> StepResponse:
    """Return the lists of a simulation as arrays."""
    ticks = np.arange(1.0, len(values) + 1.0)
    return StepResponse(
        TICK_S * ticks, np.array(values, dtype=np.float64), np.array(commands, dtype=np.float64)
    )


class _PlaneWithTailcone:
    """Plane behind the tailcone's delay, lag, rate limit and travel, relative to level flight.

    Plane: x' = A x + B a with the duct angle a constant over a tick (exact discretisation). Lag:
    a'' = wn^2 (u - a) - 2 zeta wn a' with |a'| limited (semi-implicit Euler).
    """

    def __init__(self, plane: LinearPlane, lag: Lag, spec: Spec) -> None:
        n_states = len(plane.B)
        transition = expm(
            np.block([[plane.A, plane.B[:, None]], [np.zeros((1, n_states + 1))]]) * TICK_S
        )
        self._Phi, self._Gamma = transition[:n_states, :n_states], transition[:n_states, n_states]
        self._lag, self._max_rate_radps = lag, math.radians(spec.rate_degps)
        # The hold of a tick is simulated here, so the queue must not contain it as a delay.
        ticks = max(0, round((lag.delay_s - SAMPLING_S) / TICK_S)) + 1
        self._queue = deque([0.0] * ticks)
        self._angle = self._rate = 0.0
        self.state: Array = np.zeros(n_states)

    def advance(self, command_rad: float) -> None:
        """Advance the plane by one tick under a surface command (rad)."""
        self._queue.append(command_rad)
        delayed_rad, wn = self._queue.popleft(), self._lag.natural_frequency_radps
        acceleration = (
            wn * wn * (delayed_rad - self._angle) - 2.0 * self._lag.damping_ratio * wn * self._rate
        )
        self._rate = min(
            self._max_rate_radps, max(-self._max_rate_radps, self._rate + acceleration * TICK_S)
        )
        self._angle += self._rate * TICK_S
        self.state = self._Phi @ self.state + self._Gamma * self._angle
