"""The autopilot's own loops round a linear plane: a change of set-point as she flies it, limits and
all.

Linear analysis knows no travel, no rate limit and no waiting integrator; these decide what a step
does. The law is the autopilot's (``autopilot.control.loops``), not a copy of it; sensors are
perfect, the sea is calm."""

import math
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from autopilot.control import loops as aboard
from autopilot.control import params
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import LoopMemory, VehicleEstimate
from sysid.control_analysis.loop_transfer import SAMPLING_S, TICK_S, Lag
from sysid.design.design_model import DesignModel
from sysid.design.specification import Spec
from sysid.models.linear_planes import LinearPlane

Array = NDArray[np.float64]


class StepResponse(NamedTuple):
    """One change of set-point, an entry a tick."""

    time_s: Array
    value: Array
    """Heading (rad) or depth (m), from where it was."""
    command_rad: Array
    """Of the surface, from where it rested."""


def heading_step(
    vehicle: DesignModel, values: Mapping[str, float], step_rad: float, seconds: float, spec: Spec
) -> StepResponse:
    """``values``: parameters by name. The rudder rests at its trim, which the bias takes from the
    travel."""
    config = params.config(values)
    states, commands, memory = [], [], LoopMemory()
    tail = _PlaneWithTailcone(vehicle.planes.yaw, vehicle.yaw_lag, spec)
    for _ in range(round(seconds / TICK_S)):
        _, r, psi = tail.state
        estimate = VehicleEstimate(
            heading_rad=float(psi), r_radps=float(r), speed_mps=config.cruise_speed_mps
        )
        wanted, memory = aboard.step_loops(
            estimate,
            Setpoint(heading_rad=step_rad),
            memory,
            config,
            TICK_S,
            heading=True,
            depth=False,
        )
        command = wanted.rudder_rad - config.rudder_trim_rad
        tail.advance(command)
        states.append(tail.state[2])
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
    """The vehicle flew level at ``level_pitch_rad``, which the depth integrator already carries."""
    config = params.config(values)
    carried = min(config.depth_i_max, max(-config.depth_i_max, -level_pitch_rad))
    states, commands, memory = [], [], LoopMemory(depth_integral_rad=carried)
    tail = _PlaneWithTailcone(vehicle.planes.pitch, vehicle.pitch_lag, spec)
    for _ in range(round(seconds / TICK_S)):
        _, q, theta, depth = tail.state
        estimate = VehicleEstimate(
            pitch_rad=float(theta) + level_pitch_rad,
            q_radps=float(q),
            depth_m=float(depth),
            depth_rate_mps=float(vehicle.planes.pitch.A[3] @ tail.state),
            speed_mps=config.cruise_speed_mps,
        )
        wanted, memory = aboard.step_loops(
            estimate, Setpoint(depth_m=step_m), memory, config, TICK_S, heading=False, depth=True
        )
        command = wanted.elevator_rad - config.elevator_trim_rad
        tail.advance(command)
        states.append(tail.state[3])
        commands.append(command)
    return _step_response(states, commands)


def _step_response(values: list[float], commands: list[float]) -> StepResponse:
    ticks = np.arange(1.0, len(values) + 1.0)
    return StepResponse(
        TICK_S * ticks, np.array(values, dtype=np.float64), np.array(commands, dtype=np.float64)
    )


class _PlaneWithTailcone:
    """A plane behind the tailcone's delay, lag, rate limit and travel; departures from level
    flight."""

    def __init__(self, plane: LinearPlane, lag: Lag, spec: Spec) -> None:
        n = len(plane.B)
        step = expm(np.block([[plane.A, plane.B[:, None]], [np.zeros((1, n + 1))]]) * TICK_S)
        self._Phi, self._Gamma = step[:n, :n], step[:n, n]
        self._lag, self._reach = lag, math.radians(spec.rate_degps)
        # The tick's own hold is half of what sampling adds.
        ticks = max(0, round((lag.delay_s - SAMPLING_S) / TICK_S)) + 1
        self._queue = deque([0.0] * ticks)
        self._angle = self._rate = 0.0
        self.state: Array = np.zeros(n)

    def advance(self, command_rad: float) -> None:
        self._queue.append(command_rad)
        late, wn = self._queue.popleft(), self._lag.natural_frequency_radps
        pull = wn * wn * (late - self._angle) - 2.0 * self._lag.damping_ratio * wn * self._rate
        self._rate = min(self._reach, max(-self._reach, self._rate + pull * TICK_S))
        self._angle += self._rate * TICK_S
        self.state = self._Phi @ self.state + self._Gamma * self._angle
