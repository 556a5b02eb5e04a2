"""Simulated steps of the autopilot's own loops around a linear plane, with all limits.

Linear analysis does not cover travel, rate limit and integrator hold, which determine the response
to a large step. The control law is the autopilot's (``autopilot.control.loops``) itself, without
LQG controllers. Sensors are perfect and there is no disturbance.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from autopilot.control import loops, params
from autopilot.control.params import Config
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import LoopMemory, VehicleEstimate
from mavlink_io import jit
from mavlink_io.jit import Native, entry_point, numeric
from mavlink_io.tick import TICK_S
from sysid.control_analysis.loop_transfer import SAMPLING_S, Lag
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
        Travel and rate limit of the tailcone.

    Returns
    -------
    StepResponse
        Heading and rudder.
    """
    config = params.config({**values, "ACT_TRAVEL_DEG": spec.travel_deg})
    begin = _Begin(
        VehicleEstimate(speed_mps=config.cruise_speed_mps), Setpoint(heading_rad=step_rad)
    )
    plant = _plane_with_tailcone(vehicle.planes.yaw, vehicle.yaw_lag, spec)
    return _step_response(config, begin, plant, seconds, heading=True)


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
        Travel and rate limit of the tailcone.
    level_pitch_rad : float
        Pitch of level flight (rad), which the depth integrator has at the start.

    Returns
    -------
    StepResponse
        Depth and elevator.
    """
    config = params.config({**values, "ACT_TRAVEL_DEG": spec.travel_deg})
    load_rad = config.level_pitch_rad - level_pitch_rad
    initial_integral_rad = min(config.depth_i_max, max(-config.depth_i_max, load_rad))
    begin = _Begin(
        VehicleEstimate(pitch_rad=level_pitch_rad, speed_mps=config.cruise_speed_mps),
        Setpoint(depth_m=step_m),
        LoopMemory(depth_integral_rad=initial_integral_rad),
    )
    plant = _plane_with_tailcone(vehicle.planes.pitch, vehicle.pitch_lag, spec)
    return _step_response(config, begin, plant, seconds, heading=False)


class _Begin(NamedTuple):
    """State of the autopilot at the start, in level flight, and its set-points."""

    estimate: VehicleEstimate
    setpoint: Setpoint
    memory: LoopMemory = LoopMemory()


class _PlaneWithTailcone(NamedTuple):
    """Plane behind the tailcone's delay, lag, rate limit and travel, relative to level flight.

    Plane: x' = A x + B a with the duct angle a constant over a tick (exact discretisation). Lag:
    a'' = wn^2 (u - a) - 2 zeta wn a' with |a'| limited (semi-implicit Euler).
    """

    transition: Array
    """exp(A T) for the tick T."""
    gamma: Array
    """Effect of the angle in a tick."""
    last_row: Array
    """Last row of A: the rate of the last state."""
    natural_frequency_radps: float
    damping_ratio: float
    max_rate_radps: float
    delay_ticks: int


def _plane_with_tailcone(plane: LinearPlane, lag: Lag, spec: Spec) -> _PlaneWithTailcone:
    """Return the discretised plane with its tailcone."""
    n_states = len(plane.B)
    transition = expm(
        np.block([[plane.A, plane.B[:, None]], [np.zeros((1, n_states + 1))]]) * TICK_S
    )
    return _PlaneWithTailcone(
        transition=np.ascontiguousarray(transition[:n_states, :n_states]),
        gamma=np.ascontiguousarray(transition[:n_states, n_states]),
        last_row=np.ascontiguousarray(plane.A[-1]),
        natural_frequency_radps=float(lag.natural_frequency_radps),
        damping_ratio=float(lag.damping_ratio),
        max_rate_radps=math.radians(spec.rate_degps),
        # The hold of a tick is simulated here, so it is no part of the delay.
        delay_ticks=1 + max(0, round((lag.delay_s - SAMPLING_S) / TICK_S)),
    )


def _step_response(
    config: Config, begin: _Begin, plant: _PlaneWithTailcone, seconds: float, *, heading: bool
) -> StepResponse:
    """Simulate a change of the set-point of one plane."""
    count = round(seconds / TICK_S)
    values, commands = np.zeros(count), np.zeros(count)
    flat = jit.native(cast(tuple[Any, ...], params.flat(config)))
    _simulate(flat, jit.native(begin), jit.native(plant), heading, values, commands)
    return StepResponse(TICK_S * np.arange(1.0, count + 1.0), values, commands)


@entry_point
def _simulate(
    config: Native, begin: Native, plant: Native, heading: bool, values: Array, commands: Array
) -> None:
    """Simulate the ticks of a step; write the last state of the plane and the commands."""
    settings, chain, setup = config.value, plant.value, begin.value
    level, memory, wn = setup.estimate, setup.memory, chain.natural_frequency_radps
    state, angle, rate = np.zeros(len(chain.gamma)), 0.0, 0.0
    for k in range(len(values)):
        if heading:
            estimate = level._replace(heading_rad=state[2], r_radps=state[1])
        else:
            depth_rate_mps = 0.0
            for i in range(len(state)):
                depth_rate_mps += chain.last_row[i] * state[i]
            estimate = level._replace(
                pitch_rad=level.pitch_rad + state[2],
                q_radps=state[1],
                depth_m=state[3],
                depth_rate_mps=depth_rate_mps,
            )
        output, memory = loops.step_pids(
            estimate, setup.setpoint, memory, settings, TICK_S, heading, not heading
        )
        if heading:
            commands[k] = output.rudder_rad - settings.rudder_trim_rad
        else:
            commands[k] = output.elevator_rad - settings.elevator_trim_rad
        delayed_rad = commands[k - chain.delay_ticks] if k >= chain.delay_ticks else 0.0
        acceleration = wn * wn * (delayed_rad - angle) - 2.0 * chain.damping_ratio * wn * rate
        rate = min(chain.max_rate_radps, max(-chain.max_rate_radps, rate + acceleration * TICK_S))
        angle += rate * TICK_S
        state = _advance(chain.transition, chain.gamma, state, angle)
        values[k] = state[-1]


@numeric
def _advance(transition: Array, gamma: Array, state: Array, angle_rad: float) -> Array:
    """Return the state of the plane after a tick with a duct angle."""
    after = np.empty(len(state))
    for i in range(len(state)):
        after[i] = gamma[i] * angle_rad
        for j in range(len(state)):
            after[i] += transition[i, j] * state[j]
    return after
