"""One mission through the autopilot's own tick on one vehicle, and the log it would produce."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from autopilot.control import core, mission, modes, params, request_handler, requests, steady
from autopilot.control.params import Config
from autopilot.control.steady import Task
from autopilot.control.types import US_PER_S, Home, Inputs, Trace, VehicleEstimate
from autopilot.control.types import Event as TextMessage
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.jit import native
from mavlink_io.mission_items import MavCmd, MissionItem
from sitl.vehicle.water import drifting
from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, LogEvent, Setpoints
from sysid.data.events import parse_text
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import closed_loop, disturbance, dynamics, instruments
from sysid.monte_carlo.closed_loop import COLUMNS, LOG_DECIMATION, TICK_US
from sysid.monte_carlo.dynamics import SimulatedVehicleState
from sysid.planes import Plane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

EXTRA_TIME_S = 300.0
"""Time (s) allowed in addition to legs and tests, for transits, waits and turns."""


class MissionRejectedError(InputError):
    """The autopilot rejects the mission; the message gives the reason."""

    code = ErrorCode.MISSION_REJECTED


class Sea(NamedTuple):
    """Disturbance, current and changes of the vehicle since identification."""

    times: float = 1.0
    """Factor on the identified disturbance."""
    current_mps: float = 0.0
    """Current (m/s) in a random direction."""
    bias_shift_rad: float = 0.0
    """Change of the rudder bias (rad), as from a bent duct."""


class NavigationRecord(NamedTuple):
    """Navigation of a recorded dive, which replaces dead reckoning; vectors are north + i east."""

    home: Home
    drift_m: ComplexArray
    """Estimated position minus that of the vehicle through the water, per tick from arming on."""
    current_mps: ComplexArray
    """Estimated current per tick."""
    fence: tuple[MissionItem, ...] = ()
    """Geofence of the dive."""
    rally: tuple[MissionItem, ...] = ()
    """Rally points of the dive."""

    def locate(
        self, estimate: VehicleEstimate, tick: int, through_water_m: complex
    ) -> VehicleEstimate:
        """Return an estimate with the recorded current, and the position with the recorded drift.

        After the last recorded tick the drift continues at its mean rate.
        """
        last = self.drift_m.size - 1
        late = max(0, tick - last)
        drift_m = self.drift_m[min(tick, last)]
        drift_m += late * (self.drift_m[-1] - self.drift_m[0]) / max(1, last)
        position_m = complex(through_water_m + drift_m)
        current_mps = complex(self.current_mps[min(tick, last)])
        return estimate._replace(
            north_m=position_m.real,
            east_m=position_m.imag,
            navigation=estimate.navigation._replace(current_mps=current_mps),
        )


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
    """Return the time after which a mission counts as unfinished.

    Parameters
    ----------
    items : sequence of MissionItem
        Mission.

    Returns
    -------
    float
        Time from the start (s).
    """
    waypoints = sum(item.command == MavCmd.NAV_WAYPOINT for item in items)
    return planned_s(items) + (1 + waypoints) * EXTRA_TIME_S


def planned_s(items: Sequence[MissionItem]) -> float:
    """Return the duration (s) of the legs and tests of a mission.

    Parameters
    ----------
    items : sequence of MissionItem
        Mission.

    Returns
    -------
    float
        Sum of delays, loiter times and tests; transits are not counted.
    """
    delays = sum(
        item.p1 for item in items if item.command in (MavCmd.NAV_DELAY, MavCmd.NAV_LOITER_TIME)
    )
    return delays + sum(item.x for item in items if item.command == MavCmd.USER_1)


def mean_depth_m(items: Sequence[MissionItem]) -> float:
    """Return the mean depth of the legs and tests of a mission, weighted with their durations.

    Parameters
    ----------
    items : sequence of MissionItem
        Mission.

    Returns
    -------
    float
        Depth (m); the last one that is commanded if no leg has a duration.
    """
    depth_m = weighted = 0.0
    for item in items:
        if item.command in (MavCmd.DO_CHANGE_ALTITUDE, MavCmd.NAV_WAYPOINT):
            depth_m = mission.new_depth_m(item)
        weighted += depth_m * planned_s([item])
    duration_s = planned_s(items)
    return weighted / duration_s if duration_s else depth_m


def fly(
    vehicle: CandidateVehicle,
    levels: dict[Plane, Noise],
    items: tuple[MissionItem, ...],
    config: Config,
    sea: Sea,
    seed: tuple[int, ...],
    *,
    fine_steps: bool = False,
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
    fine_steps : bool
        Take four integration steps in every tick, also clear of surface and floor.

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
    craft = dynamics.initial_state(
        _with_bias_shift(vehicle, sea.bias_shift_rad),
        water,
        instruments.field_nwu(config),
        fine_steps=fine_steps,
    )
    wrenches = disturbance.wrenches(vehicle, levels, sea.times, disturbance_rng)
    errors = instruments.errors(levels, sensor_rng, sea.times)
    return fly_with(craft, wrenches, errors, items, config)


def fly_with(
    craft: SimulatedVehicleState,
    wrenches: Iterator[Array],
    errors: Iterator[Array],
    items: tuple[MissionItem, ...],
    config: Config,
    navigation: NavigationRecord | None = None,
) -> SimulatedDive:
    """Simulate a mission with given disturbances and measurement errors.

    Parameters
    ----------
    craft : SimulatedVehicleState
        Vehicle in its initial state; its arrays change.
    wrenches : iterator of ndarray
        Disturbance of the next ticks from arming on, (n, 6), N and N m in FLU; without end.
    errors : iterator of ndarray
        Measurement errors of the next ticks, (n, N_OBSERVED); without end.
    items : tuple of MissionItem
        Mission.
    config : Config
        Parameters of the autopilot.
    navigation : NavigationRecord, optional
        Recorded navigation; without it the autopilot integrates its own speed, home is unknown.

    Returns
    -------
    SimulatedDive
        Log and outcome.

    Raises
    ------
    MissionRejectedError
        The autopilot rejects the mission or does not arm.
    """
    dive = _Dive(craft, _Rows(wrenches), _Rows(errors), config, navigation)
    dive.full_tick(dive.observed)
    dive.arm_in_mission(items)
    limit_us = limit_s(items) * US_PER_S
    while dive.in_mission and dive.state.time_us < limit_us:
        task = None if dive.follows_recorded_navigation else steady.task_of(dive.state, config)
        if task is None:
            dive.advance()
        else:
            dive.advance_steadily(task._replace(until_us=min(task.until_us, int(limit_us))))
    return dive.result()


class _Rows:
    """Random numbers by rows, drawn in blocks."""

    def __init__(self, blocks: Iterator[Array]) -> None:
        self._blocks = blocks
        self._block: Array = np.empty((0, 0))

    def ahead(self) -> Array:
        """Return the next rows, at least one."""
        if not len(self._block):
            self._block = next(self._blocks)
        return self._block

    def skip(self, count: int) -> None:
        """Drop the next rows, of which ``ahead`` has returned at least ``count``."""
        self._block = self._block[count:]

    def pop(self) -> Array:
        """Return the next row and drop it."""
        row: Array = self.ahead()[0]
        self.skip(1)
        return row


class _Dive:
    """One dive in progress: vehicle, noise, autopilot, and the log so far."""

    def __init__(
        self,
        craft: SimulatedVehicleState,
        wrenches: _Rows,
        errors: _Rows,
        config: Config,
        navigation: NavigationRecord | None,
    ) -> None:
        self._craft, self._wrenches, self._errors = craft, wrenches, errors
        self._config, self._flat = config, native(cast(tuple[Any, ...], params.flat(config)))
        self.state, self._trace = core.initial_state(), Trace()
        self._navigation = navigation
        if navigation:
            self.state = self.state._replace(home=navigation.home)
        self._messages = list[LogEvent]()
        self._rows = list[Array]()

    @property
    def observed(self) -> Array:
        """Ideal measurements after the last tick of the vehicle."""
        return self._craft.observed

    @property
    def in_mission(self) -> bool:
        """Whether the autopilot flies the mission."""
        return self.state.armed and self.state.mode == modes.MISSION.number

    @property
    def follows_recorded_navigation(self) -> bool:
        """Whether the path over ground needs the recorded navigation in every tick."""
        return self._navigation is not None and self.state.path is not None

    def _locate(self) -> None:
        """Set position and current by the recorded navigation, if there is one."""
        if self._navigation:
            tick = self.state.time_us // TICK_US
            through_water_m = dynamics.horizontal_m(self._craft)
            estimate = self._navigation.locate(self.state.estimate, tick, through_water_m)
            self.state = self.state._replace(estimate=estimate)

    def arm_in_mission(self, items: tuple[MissionItem, ...]) -> None:
        """Load the plans, set mode MISSION and arm. Raises MissionRejectedError."""
        recorded = self._navigation
        for request in (
            requests.LoadFence(recorded.fence if recorded else ()),
            requests.LoadRally(recorded.rally if recorded else ()),
            requests.LoadMission(items),
            requests.SetMode(modes.MISSION.number),
            requests.Arm(),
        ):
            self.state, answer, _ = request_handler.handle_request(
                self.state, request, self._config
            )
            if answer.result:
                raise MissionRejectedError(answer.text)

    def advance(self) -> None:
        """Advance vehicle and autopilot by one tick."""
        trace = self._trace
        observed = dynamics.advance(
            self._craft, trace.rudder_rad, trace.elevator_rad, trace.thrust, self._wrenches.pop()
        )
        self.full_tick(observed)
        self._log()

    def advance_steadily(self, task: Task) -> None:
        """Advance until a tick is not a steady one, that tick included, or the noise ends."""
        wrenches, errors = self._wrenches.ahead(), self._errors.ahead()
        count = min(len(wrenches), len(errors))
        test, signal = self.state.test, closed_loop.NO_SIGNAL
        if test is not None:
            signal = closed_loop.signal_of(
                test._replace(started_us=0, heading_rad=0.0, depth_m=0.0)
            )
        rows = np.empty((count // LOG_DECIMATION + 1, len(COLUMNS)))
        ticks, complete, pilot, self._trace, samples = closed_loop.run(
            *self._craft,
            steady.begin(self.state),
            self._trace,
            task,
            self._flat,
            wrenches[:count],
            errors[:count],
            signal,
            rows,
        )
        self.state = steady.end(self.state, pilot)
        self._locate()
        self._rows.append(rows[:samples])
        self._wrenches.skip(ticks)
        self._errors.skip(ticks if complete else ticks - 1)
        if not complete:
            self.full_tick(self.observed)
            self._log()

    def full_tick(self, observed: Array) -> None:
        """Run one tick of the autopilot and collect its messages."""
        state = self.state
        time_us = state.time_us + TICK_US if state.time_us >= 0 else 0
        frame = instruments.frame(time_us, observed, self._errors.pop(), self._config)
        inputs = Inputs(frame, None, None, None)
        self.state, _, self._trace, events = core.tick(state, inputs, self._config)
        self._locate()
        self._messages += [
            LogEvent(time_us / US_PER_S, parse_text(event.severity, event.text))
            for event in events
            if isinstance(event, TextMessage)
        ]

    def _log(self) -> None:
        """Add a sample to the log if one is due."""
        if self.state.time_us % (LOG_DECIMATION * TICK_US) == 0:
            self._rows.append(self._sample())

    def _sample(self) -> Array:
        """Return one sample of the log, (1, number of columns)."""
        true_depth_m = float(self.observed[dynamics.DEPTH])
        pilot = steady.begin(self.state)
        return np.array([closed_loop.log_sample(pilot, self._trace, true_depth_m)])

    def result(self) -> SimulatedDive:
        """Return log and outcome."""
        state = self.state
        rows = np.concatenate(self._rows) if self._rows else self._sample()
        columns = dict(zip(COLUMNS, rows.T if len(rows) else self._sample().T, strict=True))
        return SimulatedDive(
            log=_log(columns, self._messages, self._config.travel_rad),
            true_depth_m=columns["true_depth_m"],
            failsafe=state.failsafe,
            finished=state.mode != modes.MISSION.number and not state.failsafe,
        )


def _with_bias_shift(vehicle: CandidateVehicle, shift_rad: float) -> CandidateVehicle:
    """Return the vehicle with a changed rudder bias."""
    rudder = vehicle.actuators[Plane.YAW]
    bent = rudder._replace(bias_rad=rudder.bias_rad + shift_rad)
    return vehicle._replace(actuators={**vehicle.actuators, Plane.YAW: bent})


def _log(columns: dict[str, Array], messages: Sequence[LogEvent], travel_rad: float) -> Log:
    """Return the columns as a log of a vehicle with surfaces of this travel, rad."""
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
            travel_rad=travel_rad,
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
