"""One mission through the autopilot's own tick on one vehicle, and the log it would produce."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import core, modes, request_handler, requests
from autopilot.control.params import Config
from autopilot.control.types import US_PER_S, AutopilotState, Inputs, Trace
from autopilot.control.types import Event as TextMessage
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.mission_items import MavCmd, MissionItem
from sitl.vehicle.water import drifting
from sysid.control_analysis.loop_transfer import TICK_S
from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, LogEvent, Setpoints
from sysid.data.events import parse_text
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import disturbance, dynamics, instruments
from sysid.planes import Plane

Array = NDArray[np.float64]

TICK_US = round(TICK_S * US_PER_S)
"""Tick in microseconds."""
LOG_DECIMATION = 5
"""Ticks per logged sample: 10 Hz."""
EXTRA_TIME_S = 300.0
"""Time (s) allowed in addition to legs and tests, for transits, waits and turns."""
COLUMNS = (
    "time_s",
    "roll_rad",
    "pitch_rad",
    "heading_rad",
    "p_radps",
    "q_radps",
    "r_radps",
    "depth_m",
    "depth_rate_mps",
    "rudder_rad",
    "elevator_rad",
    "thrust",
    "heading_setpoint_rad",
    "pitch_setpoint_rad",
    "depth_setpoint_m",
    "true_depth_m",
)
"""Columns of the simulated log."""


class MissionRejectedError(InputError):
    """The autopilot rejects the mission; the message says why."""

    code = ErrorCode.MISSION_REJECTED


class Sea(NamedTuple):
    """Disturbance, current and changes of the vehicle since identification."""

    times: float = 1.0
    """Factor on the identified disturbance."""
    current_mps: float = 0.0
    """Current (m/s) in a random direction."""
    bias_shift_rad: float = 0.0
    """Change of the rudder bias (rad), as from a bent duct."""


class SimulatedDive(NamedTuple):
    """Log and outcome of one dive."""

    log: Log
    """Log as the autopilot would write it."""
    true_depth_m: Array
    """True depth at the log's samples (m)."""
    failsafe: str
    """Reason for an early end of the mission; empty without one."""
    finished: bool
    """Whether the mission was completed."""

    @property
    def seconds(self) -> float:
        """Return the vehicle time at the end of the log (s)."""
        return float(self.log.attitude.time_s[-1])


def limit_s(items: Sequence[MissionItem]) -> float:
    """Return the time (s) after which a mission counts as unfinished."""
    delays = sum(
        item.p1 for item in items if item.command in (MavCmd.NAV_DELAY, MavCmd.NAV_LOITER_TIME)
    )
    tests = sum(item.x for item in items if item.command == MavCmd.USER_1)
    waypoints = sum(item.command == MavCmd.NAV_WAYPOINT for item in items)
    return delays + tests + (1 + waypoints) * EXTRA_TIME_S


def fly(
    vehicle: CandidateVehicle,
    levels: dict[Plane, Noise],
    items: tuple[MissionItem, ...],
    config: Config,
    sea: Sea,
    seed: tuple[int, ...],
) -> SimulatedDive:
    """Simulate a mission from arming at the surface until the vehicle returns to the surface.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    levels : dict
        Noise model of each plane.
    items : tuple of MissionItem
        Mission.
    config : Config
        Parameters of the autopilot.
    sea : Sea
        Disturbance, current and change of bias.
    seed : tuple of int
        Seed of disturbance, sensor noise and direction of the current.

    Returns
    -------
    SimulatedDive
        Log and outcome.

    Raises
    ------
    MissionRejectedError
        The autopilot rejects the mission or does not arm.
    """
    streams = np.random.SeedSequence(seed).spawn(3)
    disturbance_rng, sensor_rng, current_rng = (np.random.default_rng(stream) for stream in streams)
    direction_rad = current_rng.uniform(-math.pi, math.pi)
    water = drifting(
        (sea.current_mps * math.cos(direction_rad), sea.current_mps * math.sin(direction_rad), 0.0)
    )
    simulated = dynamics.initial_state(
        _with_bias_shift(vehicle, sea.bias_shift_rad), water, instruments.field_nwu(config)
    )
    wrenches, errors = (
        disturbance.wrenches(vehicle, levels, sea.times, disturbance_rng),
        instruments.errors(levels, sensor_rng),
    )
    messages, rows = list[LogEvent](), list[tuple[float, ...]]()
    state, trace = _tick(core.initial_state(), simulated.observed + next(errors), config, messages)
    state = _arm_in_mission(state, items, config)
    limit_us = limit_s(items) * US_PER_S
    while state.armed and state.mode == modes.MISSION.number and state.time_us < limit_us:
        observed = dynamics.advance(
            simulated, trace.rudder_rad, trace.elevator_rad, trace.thrust, next(wrenches)
        )
        state, trace = _tick(state, observed + next(errors), config, messages)
        if state.time_us % (LOG_DECIMATION * TICK_US) == 0:
            rows.append(_row(state, trace, float(observed[dynamics.DEPTH])))
    finished = state.mode != modes.MISSION.number and not state.failsafe
    rows = rows or [_row(state, trace, float(simulated.observed[dynamics.DEPTH]))]
    columns = dict(zip(COLUMNS, np.array(rows).T, strict=True))
    return SimulatedDive(
        log=_log(columns, messages),
        true_depth_m=columns["true_depth_m"],
        failsafe=state.failsafe,
        finished=finished,
    )


def _with_bias_shift(vehicle: CandidateVehicle, shift_rad: float) -> CandidateVehicle:
    """Return the vehicle with a changed rudder bias."""
    rudder = vehicle.actuators[Plane.YAW]
    bent = rudder._replace(bias_rad=rudder.bias_rad + shift_rad)
    return vehicle._replace(actuators={**vehicle.actuators, Plane.YAW: bent})


def _tick(
    state: AutopilotState, reading: Array, config: Config, messages: list[LogEvent]
) -> tuple[AutopilotState, Trace]:
    """Run one tick of the autopilot and collect its messages."""
    time_us = state.time_us + TICK_US if state.time_us >= 0 else 0
    inputs = Inputs(instruments.frame(time_us, reading, config), None, None, None)
    state, _, trace, events = core.tick(state, inputs, config)
    messages += [
        LogEvent(time_us / US_PER_S, parse_text(event.severity, event.text))
        for event in events
        if isinstance(event, TextMessage)
    ]
    return state, trace


def _arm_in_mission(
    state: AutopilotState, items: tuple[MissionItem, ...], config: Config
) -> AutopilotState:
    """Load the mission, set mode MISSION and arm. Raises MissionRejectedError."""
    for request in (
        requests.LoadMission(items),
        requests.SetMode(modes.MISSION.number),
        requests.Arm(),
    ):
        state, answer, _ = request_handler.handle_request(state, request, config)
        if answer.result:
            raise MissionRejectedError(answer.text)
    return state


def _row(state: AutopilotState, trace: Trace, true_depth_m: float) -> tuple[float, ...]:
    """Return one sample of the log."""
    estimate, setpoint = state.estimate, state.setpoint
    return (
        state.time_us / US_PER_S,
        estimate.roll_rad,
        estimate.pitch_rad,
        estimate.heading_rad,
        estimate.p_radps,
        estimate.q_radps,
        estimate.r_radps,
        estimate.depth_m,
        estimate.depth_rate_mps,
        trace.rudder_rad,
        trace.elevator_rad,
        trace.thrust,
        setpoint.heading_rad,
        trace.pitch_setpoint_rad,
        setpoint.depth_m,
        true_depth_m,
    )


def _log(columns: dict[str, Array], messages: Sequence[LogEvent]) -> Log:
    """Return the columns as a log."""
    time_s = columns["time_s"]
    return Log(
        name="rehearsal",
        sha256="",
        attitude=Attitude(
            time_s=time_s,
            roll_rad=columns["roll_rad"],
            pitch_rad=columns["pitch_rad"],
            yaw_rad=np.unwrap(columns["heading_rad"]),
            p_radps=columns["p_radps"],
            q_radps=columns["q_radps"],
            r_radps=columns["r_radps"],
        ),
        actuators=Actuators(
            time_s=time_s,
            rudder_rad=columns["rudder_rad"],
            elevator_rad=columns["elevator_rad"],
            thrust=columns["thrust"],
        ),
        depth=Depth(time_s, columns["depth_m"], columns["depth_rate_mps"]),
        setpoints=Setpoints(
            attitude_time_s=time_s,
            heading_rad=np.unwrap(columns["heading_setpoint_rad"]),
            pitch_rad=columns["pitch_setpoint_rad"],
            depth_time_s=time_s,
            depth_m=columns["depth_setpoint_m"],
        ),
        events=tuple(messages),
        parameters={},
        duct=DuctAngles(np.empty(0), np.empty(0), np.empty(0)),
    )
