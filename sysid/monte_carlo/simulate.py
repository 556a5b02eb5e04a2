"""One mission through the autopilot's own tick, on one vehicle in one sea, as the log that it would
leave."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import core, modes, request_handler, requests
from autopilot.control.params import Config
from autopilot.control.types import US_PER_S, AutopilotState, Inputs, Trace
from autopilot.control.types import Event as Said
from mavlink_io.mission_items import MavCmd, MissionItem
from sitl.vehicle.water import drifting
from sysid.control_analysis.loop_transfer import TICK_S
from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, Setpoints, TextEvent
from sysid.data.segments import Plane
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import disturbance, dynamics, instruments

Array = NDArray[np.float64]

TICK_US = round(TICK_S * US_PER_S)
LOG_DECIMATION = 5
"""Of so many ticks one is kept: 10 Hz."""
EXTRA_TIME_S = 300.0
"""Beyond the mission's own legs and tests, for ways, waits and turns."""
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


class MissionRejectedError(ValueError):
    """A mission that the autopilot does not take; the message says why."""


class Sea(NamedTuple):
    """Where a vehicle is rehearsed, and what has become of her since the model was made."""

    times: float = 1.0
    """The disturbance that the model found, so many times over."""
    current_mps: float = 0.0
    """Towards anywhere."""
    bias_shift_rad: float = 0.0
    """Of the rudder: a bent duct."""


class SimulatedDive(NamedTuple):
    log: Log
    """As told by the vehicle herself."""
    true_depth_m: Array
    """At the log's samples."""
    failsafe: str
    """What ended the mission before its time; empty where nothing did."""
    finished: bool
    """The mission came to its end."""

    @property
    def seconds(self) -> float:
        return float(self.log.attitude.time_s[-1])


def limit_s(items: Sequence[MissionItem]) -> float:
    """Vehicle seconds after which a mission counts as unfinished."""
    delays = sum(
        item.p1 for item in items if item.command in (MavCmd.NAV_DELAY, MavCmd.NAV_LOITER_TIME)
    )
    tests = sum(item.x for item in items if item.command == MavCmd.USER_1)
    ways = sum(item.command == MavCmd.NAV_WAYPOINT for item in items)
    return delays + tests + (1 + ways) * EXTRA_TIME_S


def fly(
    vehicle: CandidateVehicle,
    levels: dict[Plane, Noise],
    items: tuple[MissionItem, ...],
    config: Config,
    sea: Sea,
    seed: tuple[int, ...],
) -> SimulatedDive:
    """From arming, awash, until the vehicle turns to the surface. The same ``seed`` is the same sea
    and instruments.

    Raises:
        RefusedError: the autopilot does not take the mission, or does not arm.
    """
    streams = np.random.SeedSequence(seed).spawn(3)
    push, err, drift = (np.random.default_rng(stream) for stream in streams)
    towards = drift.uniform(-math.pi, math.pi)
    water = drifting(
        (sea.current_mps * math.cos(towards), sea.current_mps * math.sin(towards), 0.0)
    )
    craft = dynamics.initial_state(
        _with_bias_shift(vehicle, sea.bias_shift_rad), water, instruments.field_nwu(config)
    )
    wrenches, errors = (
        disturbance.wrenches(vehicle, levels, sea.times, push),
        instruments.errors(levels, err),
    )
    said, rows = list[TextEvent](), list[tuple[float, ...]]()
    state, trace = _tick(core.initial_state(), craft.seen + next(errors), config, said)
    state = _arm_in_mission(state, items, config)
    most_us = limit_s(items) * US_PER_S
    while state.armed and state.mode == modes.MISSION.number and state.time_us < most_us:
        seen = dynamics.advance(
            craft, trace.rudder_rad, trace.elevator_rad, trace.thrust, next(wrenches)
        )
        state, trace = _tick(state, seen + next(errors), config, said)
        if state.time_us % (LOG_DECIMATION * TICK_US) == 0:
            rows.append(_row(state, trace, float(seen[dynamics.DEPTH])))
    finished = state.mode != modes.MISSION.number and not state.failsafe
    rows = rows or [_row(state, trace, float(craft.seen[dynamics.DEPTH]))]
    columns = dict(zip(COLUMNS, np.array(rows).T, strict=True))
    return SimulatedDive(_log(columns, said), columns["true_depth_m"], state.failsafe, finished)


def _with_bias_shift(vehicle: CandidateVehicle, shift_rad: float) -> CandidateVehicle:
    rudder = vehicle.actuators["yaw"]
    bent = rudder._replace(bias_rad=rudder.bias_rad + shift_rad)
    return vehicle._replace(actuators={**vehicle.actuators, "yaw": bent})


def _tick(
    state: AutopilotState, reading: Array, config: Config, said: list[TextEvent]
) -> tuple[AutopilotState, Trace]:
    time_us = state.time_us + TICK_US if state.time_us >= 0 else 0
    inputs = Inputs(instruments.frame(time_us, reading, config), None, None, None)
    state, _, trace, events = core.tick(state, inputs, config)
    said += [
        TextEvent(time_us / US_PER_S, e.severity, e.text) for e in events if isinstance(e, Said)
    ]
    return state, trace


def _arm_in_mission(
    state: AutopilotState, items: tuple[MissionItem, ...], config: Config
) -> AutopilotState:
    """Armed, in MISSION. Raises RefusedError."""
    for wish in (
        requests.LoadMission(items),
        requests.SetMode(modes.MISSION.number),
        requests.Arm(),
    ):
        state, answer, _ = request_handler.handle_request(state, wish, config)
        if answer.result:
            raise MissionRejectedError(answer.text)
    return state


def _row(state: AutopilotState, trace: Trace, true_depth_m: float) -> tuple[float, ...]:
    at, wanted = state.estimate, state.setpoint
    return (
        state.time_us / US_PER_S,
        at.roll_rad,
        at.pitch_rad,
        at.heading_rad,
        at.p_radps,
        at.q_radps,
        at.r_radps,
        at.depth_m,
        at.depth_rate_mps,
        trace.rudder_rad,
        trace.elevator_rad,
        trace.thrust,
        wanted.heading_rad,
        trace.pitch_setpoint_rad,
        wanted.depth_m,
        true_depth_m,
    )


def _log(c: dict[str, Array], said: Sequence[TextEvent]) -> Log:
    time_s = c["time_s"]
    return Log(
        name="rehearsal",
        sha256="",
        attitude=Attitude(
            time_s,
            c["roll_rad"],
            c["pitch_rad"],
            np.unwrap(c["heading_rad"]),
            c["p_radps"],
            c["q_radps"],
            c["r_radps"],
        ),
        actuators=Actuators(time_s, c["rudder_rad"], c["elevator_rad"], c["thrust"]),
        depth=Depth(time_s, c["depth_m"], c["depth_rate_mps"]),
        setpoints=Setpoints(
            time_s,
            np.unwrap(c["heading_setpoint_rad"]),
            c["pitch_setpoint_rad"],
            time_s,
            c["depth_setpoint_m"],
        ),
        events=tuple(said),
        parameters={},
        duct=DuctAngles(np.empty(0), np.empty(0), np.empty(0)),
    )
