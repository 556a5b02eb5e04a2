"""The vehicle: state and configuration around the pure tick, shared by HIL loop and ground."""

import math

from autopilot.control import core, mission, modes, request_handler, requests
from autopilot.control.failsafe import ground_lost
from autopilot.control.params import Config, ParamError, ParamTable
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import has_data
from autopilot.control.types import (
    ACCEPTED,
    DENIED,
    UNSUPPORTED,
    Answer,
    AutopilotState,
    Event,
    Inputs,
    ItemReached,
    MissionState,
    Severity,
    Stick,
    Trace,
    Trim,
)
from autopilot.pilot import Pilot
from autopilot.reports import Snapshot, SteadyReport, TickReport
from autopilot.steady_ticks import Expected, NewRecords
from mavlink_io.endpoint import Endpoint
from mavlink_io.mission_items import (
    FENCE_TYPE,
    FRAME_GLOBAL,
    GLOBAL_SCALE,
    NOT_GIVEN,
    MavCmd,
    MissionItem,
)
from mavlink_io.records import (
    ActuatorFrame,
    Altimeter,
    Battery,
    GpsFix,
    Leak,
    SensorFrame,
)
from mavlink_io.services import missions
from mavlink_io.services.mission_server import MissionProgress, MissionResult

MIN_TRIM_TIME_CONSTANTS = 2.0
"""Trims are stored when they were learned for this many times ``config.trim_time_s``."""
FIX_TIMEOUT_US = 1_500_000
"""Age above which a satellite fix is dropped: the vehicle has dived."""

NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5
"""Values of MISSION_STATE."""
NO_ITEMS = 0xFFFF
"""Value of MISSION_CURRENT.total without a mission."""


class Vehicle:
    """State of the autopilot, changed by ticks and by requests, with a list of pending events."""

    def __init__(self, params: ParamTable, *, compiled: bool = False) -> None:
        """``compiled`` selects compiled steady ticks, for flights faster than real time."""
        self.params, self.system, self.compiled = params, params.config.system_id, compiled
        self._pilot = Pilot(compiled=compiled)
        self._events: list[Event | ItemReached] = []
        self._begin()

    def _begin(self) -> None:
        """Set all state to its initial value."""
        self.state = core.initial_state()
        self._pilot.trace = Trace()
        self._sensors: SensorFrame | None = None
        self._is_decoded = True
        """Whether ``_sensors`` and ``_actuators`` are those of the newest tick."""
        self._fix: GpsFix | None = None
        self._altimeter: Altimeter | None = None
        self._battery: Battery | None = None
        self._leak: Leak | None = None
        self._stick: Stick | None = None
        self._intended_mode = self.state.mode
        self._actuators = self.repeat_last()

    @property
    def state(self) -> AutopilotState:
        """State after the last tick or request."""
        return self._pilot.state

    @state.setter
    def state(self, state: AutopilotState) -> None:
        self._pilot.state = state

    @property
    def time_us(self) -> int:
        """Vehicle time of the last tick, without the cost of ``state``; -1 before the first."""
        return self._pilot.time_us

    @property
    def armed(self) -> bool:
        """Whether the vehicle is armed."""
        return self._pilot.armed

    @property
    def changes(self) -> int:
        """Number of changes of the state other than by ticks in which only numbers change."""
        return self._pilot.changes

    def tick(self, inputs: Inputs) -> ActuatorFrame:
        """Run one control tick at the time stamp of the sensors and return the actuators."""
        config = self.params.config
        if self._pilot.advance(inputs, config):
            self._actuators = core.armed_frame(self.time_us, self._pilot.trace, config)
        else:
            self._tick_fully(inputs, config)
        self._sensors, self._stick, self._is_decoded = inputs.sensors, inputs.stick, True
        if has_data(inputs):
            self._update_devices(inputs)
        elif self._fix is not None:
            self._fix = self._recent_fix()
        return self._actuators

    def allows_exchange(self, ground_silent_s: float | None) -> bool:
        """Return whether the next ticks may be exchanges, for the silence of the ground station."""
        return self._pilot.armed and not ground_lost(ground_silent_s, self.params.config)

    def exchange(self, endpoint: Endpoint, expected: Expected) -> list[SteadyReport]:
        """Answer the samples of steady ticks in compiled code; return the result of each tick.

        The list is empty if the next tick has to be a full one.
        """
        config, pilot = self.params.config, self._pilot
        results = pilot.exchange(endpoint, expected, config)
        if results:
            self._is_decoded = False
        path, home = pilot.path, pilot.home
        reports = []
        for tick in results:
            if tick.devices is not None:
                self._update_devices(tick.devices)
            reports.append(SteadyReport(tick, config, path, home, self._altimeter))
        return reports

    def _decode(self) -> None:
        """Make the records of the newest tick, if that was an exchange."""
        results = self._pilot.results
        if not self._is_decoded and results is not None:
            self._sensors, self._is_decoded = results.sensors, True
            self._actuators = core.armed_frame(self.time_us, results.trace, self.params.config)

    def _tick_fully(self, inputs: Inputs, config: Config) -> None:
        """Run a tick in which more than numbers may change."""
        before = self.state
        self._events += self._pilot.tick(inputs, config)
        self._actuators = self.repeat_last()
        self._update_intended_mode()
        if before.armed and not self.state.armed:
            self._store_trim(before.loops.trim)

    def _update_devices(self, new: Inputs | NewRecords) -> None:
        """Keep the newest record of each device."""
        self._fix = new.gps or self._recent_fix()
        self._altimeter = new.altimeter or self._altimeter
        self._battery = new.battery or self._battery
        self._leak = new.leak or self._leak

    def repeat_last(self) -> ActuatorFrame:
        """Return the last actuators for a repeated sample, with the present arming state."""
        return core.actuator_frame(self.state, self._pilot.trace, self.params.config)

    def handle_request(self, request: requests.Request, *, quiet: bool = False) -> Answer:
        """Apply a request from ground and return the answer.

        The reason of a refusal is sent as a text, unless ``quiet``.
        """
        before = self.state._replace(charge=self._charge())
        self.state, answer, events = request_handler.handle_request(
            before, request, self.params.config
        )
        self._events += events
        if before.armed and not self.state.armed:
            self._store_trim(before.loops.trim)
        if answer.result != ACCEPTED and answer.text and not quiet:
            self.send_statustext(answer.text)
        self._update_intended_mode()
        return answer

    def _charge(self) -> float:
        """Return the remaining fraction of the battery; 1 if it is not known."""
        remaining = math.nan if self._battery is None else self._battery.remaining
        return 1.0 if math.isnan(remaining) else remaining

    def restart(self, reason: str) -> None:
        """Reset the state as after a reboot; keep parameters and plans."""
        before = self.state
        self._begin()
        loaded = mission.restart(MissionState(before.mission.items), self.params.config)
        self.state = self.state._replace(mission=loaded, fence=before.fence, rally=before.rally)
        self.send_statustext(f"Restarted: {reason}", Severity.NOTICE)

    def continue_from(self, state: AutopilotState, intended_mode: int) -> None:
        """Continue with the state of a process that has ended."""
        self.state, self._intended_mode = state, intended_mode

    def surface_from(self, state: AutopilotState) -> None:
        """Begin with a new state, armed as before, in mode SURFACE; keep plans and home.

        For a state that ends the process each time that it is continued.
        """
        loaded = mission.restart(MissionState(state.mission.items), self.params.config)
        self.state = core.initial_state()._replace(
            mode=modes.SURFACE.number,
            armed=state.armed,
            home=state.home,
            mission=loaded,
            fence=state.fence,
            rally=state.rally,
        )
        self._intended_mode = self.state.mode

    @property
    def intended_mode(self) -> int:
        """Mode that was last requested; a failsafe may have selected another one."""
        return self._intended_mode

    def on_sensor_loss(self) -> None:
        """Report that samples no longer arrive.

        Arming is refused until samples have arrived again for some time.
        """
        self.state = monitor.report_sensor_loss(self.state)
        self.send_statustext("Sensor timeout", Severity.ERROR)

    def send_statustext(self, text: str, severity: Severity = Severity.WARNING) -> None:
        """Queue a text for every ground station."""
        self._events.append(Event(severity, text))

    @property
    def has_events(self) -> bool:
        """Whether there are events since the last ``pop_events``."""
        return bool(self._events)

    def pop_events(self) -> list[Event | ItemReached]:
        """Return the events since the last call, in order."""
        events, self._events = self._events, []
        return events

    def snapshot(self) -> Snapshot:
        """Return the state after the newest tick."""
        if not self._is_decoded:
            self._fix = self._recent_fix()
        self._decode()
        return Snapshot(
            state=self.state,
            trace=self._pilot.trace,
            actuators=self._actuators,
            sensors=self._sensors,
            fix=self._fix,
            config=self.params.config,
            intended_mode=self._intended_mode,
            altimeter=self._altimeter,
            battery=self._battery,
            leak=self._leak,
            stick=self._stick,
        )

    def report(self) -> TickReport | SteadyReport:
        """Return the result of the newest tick."""
        pilot = self._pilot
        if pilot.results is not None:
            return SteadyReport(
                pilot.results, self.params.config, pilot.path, pilot.home, self._altimeter
            )
        return TickReport(
            time_us=pilot.time_us,
            motion=pilot.motion,
            setpoint=pilot.setpoint,
            path=pilot.path,
            home=pilot.home,
            trace=pilot.trace,
            actuators=self._actuators,
            sensors=self._sensors,
            altimeter=self._altimeter,
        )

    def _store_trim(self, trim: Trim) -> None:
        """Store the trims as parameters at disarming, when they were learned for long enough."""
        config = self.params.config
        if not config.trim_time_s or trim.learned_s < MIN_TRIM_TIME_CONSTANTS * config.trim_time_s:
            return
        learned = {
            "TRIM_RUD_DEG": config.rudder_trim_deg + math.degrees(trim.rudder_rad),
            "TRIM_ELE_DEG": config.elevator_trim_deg + math.degrees(trim.elevator_rad),
        }
        try:
            stored = [
                f"{name} {self.params.set(name, round(value, 3)):g}"
                for name, value in learned.items()
            ]
        except ParamError as error:
            self.send_statustext(f"Trim not stored: {error}")
            return
        self.send_statustext(f"Trim learned: {', '.join(stored)}", Severity.NOTICE)

    def _recent_fix(self) -> GpsFix | None:
        """Return the last satellite fix while it is not older than FIX_TIMEOUT_US."""
        fix = self._fix
        return fix if fix is not None and self.time_us - fix.time_us < FIX_TIMEOUT_US else None

    def _update_intended_mode(self) -> None:
        """Record the mode, unless a failsafe has selected it, and lock parameters while armed."""
        self.params.armed = self.state.armed
        if not self.state.failsafe:
            self._intended_mode = self.state.mode


class VehicleMission:
    """Adapter of the vehicle's mission for the mission protocol."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """Items of the loaded mission; home alone if item 0 is home and no mission is loaded.

        DroneKit waits for an item in vain if the list is empty.
        """
        items, home = self._vehicle.state.mission.items, self._vehicle.state.home
        if items or not home.known or not self._vehicle.params.config.mission_seq0_home:
            return items
        return (
            MissionItem(
                0,
                FRAME_GLOBAL,
                MavCmd.NAV_WAYPOINT,
                x=round(home.lat_deg * GLOBAL_SCALE),
                y=round(home.lon_deg * GLOBAL_SCALE),
            ),
        )

    @property
    def progress(self) -> MissionProgress:
        """Values of MISSION_CURRENT."""
        return mission_progress(self._vehicle.state, self._vehicle.params.config)

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        """Replace the mission; return the MAV_MISSION_RESULT."""
        return _mission_result(self._vehicle.handle_request(requests.LoadMission(items)))

    def set_current(self, sequence: int) -> bool:
        """Continue the mission at an item; return whether this was accepted.

        The mission protocol sends the reason of a refusal.
        """
        request = requests.SetMissionItem(sequence)
        return self._vehicle.handle_request(request, quiet=True).result == ACCEPTED

    def go_to(self, item: MissionItem) -> MissionResult:
        """Circle the place of an item in STATION; without a place change the depth."""
        command = (
            MavCmd.CONDITION_CHANGE_ALT
            if NOT_GIVEN in (item.x, item.y)
            else MavCmd.NAV_LOITER_UNLIM
        )
        answer = self._vehicle.handle_request(requests.GoTo(item._replace(command=command, p3=0.0)))
        return MissionResult(_MISSION_RESULTS.get(answer.result, missions.DENIED))

    def explain(self, text: str) -> None:
        """Send the reason of a refusal to ground."""
        self._vehicle.send_statustext(text)


class VehiclePlan:
    """Adapter of geofence or rally points for the mission protocol."""

    def __init__(self, vehicle: Vehicle, kind: int) -> None:
        self._vehicle, self._kind = vehicle, kind

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """Items of the loaded plan."""
        state = self._vehicle.state
        return state.fence.items if self._kind == FENCE_TYPE else state.rally.items

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        """Replace the plan; return the MAV_MISSION_RESULT."""
        load_request = requests.LoadFence if self._kind == FENCE_TYPE else requests.LoadRally
        return _mission_result(self._vehicle.handle_request(load_request(items)))


_MISSION_RESULTS = {
    ACCEPTED: missions.ACCEPTED,
    DENIED: missions.INVALID,
    UNSUPPORTED: missions.UNSUPPORTED,
}


def _mission_result(answer: Answer) -> MissionResult:
    """Return the MAV_MISSION_RESULT of an answer to a plan."""
    if answer.parameter:
        return MissionResult(missions.INVALID_PARAM1 + answer.parameter - 1)
    return MissionResult(_MISSION_RESULTS.get(answer.result, missions.DENIED))


def mission_progress(state: AutopilotState, config: Config) -> MissionProgress:
    """Return the values of MISSION_CURRENT; the total does not count home where it is item 0."""
    mission_state, total = state.mission, len(state.mission.items)
    in_mission_mode = state.mode == modes.MISSION.number
    if not total:
        stage = NO_MISSION
    elif mission_state.current >= total:
        stage = COMPLETE
    elif state.armed and (in_mission_mode or mission.is_ending(state)):
        stage = ACTIVE
    else:
        stage = PAUSED if mission_state.reached >= 0 else NOT_STARTED
    item_count = total - config.mission_seq0_home if total else NO_ITEMS
    return MissionProgress(
        sequence=min(mission_state.current, max(0, total - 1)),
        total=item_count,
        mission_state=stage,
        mission_mode=1 if in_mission_mode else 2,
    )
