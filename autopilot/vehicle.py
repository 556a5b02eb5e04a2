"""The vehicle: state and configuration around the pure tick, shared by HIL loop and ground."""

import math
from typing import NamedTuple

from autopilot.control import core, mission, modes, request_handler, requests
from autopilot.control.params import Config, ParamError, ParamTable
from autopilot.control.sensor_health import monitor
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
    Trace,
    Trim,
)
from mavlink_io.mission_items import MissionItem
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


class Snapshot(NamedTuple):
    """State of the vehicle after a tick, as telemetry and the log use it."""

    state: AutopilotState
    trace: Trace
    actuators: ActuatorFrame
    sensors: SensorFrame | None
    fix: GpsFix | None
    """Newest satellite fix; None when it is older than FIX_TIMEOUT_US."""
    config: Config
    intended_mode: int
    """Mode that was last requested; a failsafe may have selected another one."""
    altimeter: Altimeter | None = None
    """Newest altimeter record; None before the first."""
    battery: Battery | None = None
    """Newest battery record; None before the first."""
    leak: Leak | None = None
    """Newest record of the leak sensor; None before the first."""


class Vehicle:
    """State of the autopilot, changed by ticks and by requests, with a list of pending events."""

    def __init__(self, params: ParamTable) -> None:
        self.params, self.system = params, params.config.system_id
        self._events: list[Event | ItemReached] = []
        self._begin()

    def _begin(self) -> None:
        """Set all state to its initial value."""
        self.state = core.initial_state()
        self._trace = Trace()
        self._sensors: SensorFrame | None = None
        self._fix: GpsFix | None = None
        self._altimeter: Altimeter | None = None
        self._battery: Battery | None = None
        self._leak: Leak | None = None
        self._intended_mode = self.state.mode
        self._actuators = core.actuator_frame(self.state, self._trace, self.params.config)

    def tick(self, inputs: Inputs) -> ActuatorFrame:
        """Run one control tick at the time stamp of the sensors and return the actuators."""
        before = self.state
        self.state, self._actuators, self._trace, events = core.tick(
            before, inputs, self.params.config
        )
        self._sensors = inputs.sensors
        self._fix = inputs.gps or self._recent_fix()
        self._altimeter = inputs.altimeter or self._altimeter
        self._battery = inputs.battery or self._battery
        self._leak = inputs.leak or self._leak
        self._events += events
        self._update_intended_mode()
        if before.armed and not self.state.armed:
            self._store_trim(before.loops.trim)
        return self._actuators

    def repeat_last(self) -> ActuatorFrame:
        """Return the last actuators for a repeated sample, with the present arming state."""
        return core.actuator_frame(self.state, self._trace, self.params.config)

    def handle_request(self, request: requests.Request) -> Answer:
        """Apply a request from ground and return the answer; send the reason of a refusal."""
        before = self.state
        self.state, answer, events = request_handler.handle_request(
            before, request, self.params.config
        )
        self._events += events
        if before.armed and not self.state.armed:
            self._store_trim(before.loops.trim)
        if answer.result != ACCEPTED and answer.text:
            self.send_statustext(answer.text)
        self._update_intended_mode()
        return answer

    def restart(self, reason: str) -> None:
        """Reset the state as after a reboot; keep parameters and mission."""
        items = self.state.mission.items
        self._begin()
        loaded = mission.restart(MissionState(items), self.params.config)
        self.state = self.state._replace(mission=loaded)
        self.send_statustext(f"Restarted: {reason}", Severity.NOTICE)

    def on_sensor_loss(self) -> None:
        """Report that samples no longer arrive.

        Arming is refused until samples have arrived again for some time.
        """
        self.state = monitor.report_sensor_loss(self.state)
        self.send_statustext("Sensor timeout", Severity.ERROR)

    def send_statustext(self, text: str, severity: Severity = Severity.WARNING) -> None:
        """Queue a text for every ground station."""
        self._events.append(Event(severity, text))

    def pop_events(self) -> list[Event | ItemReached]:
        """Return the events since the last call, in order."""
        events, self._events = self._events, []
        return events

    def snapshot(self) -> Snapshot:
        """Return the state after the newest tick."""
        return Snapshot(
            state=self.state,
            trace=self._trace,
            actuators=self._actuators,
            sensors=self._sensors,
            fix=self._fix,
            config=self.params.config,
            intended_mode=self._intended_mode,
            altimeter=self._altimeter,
            battery=self._battery,
            leak=self._leak,
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
        return (
            fix if fix is not None and self.state.time_us - fix.time_us < FIX_TIMEOUT_US else None
        )

    def _update_intended_mode(self) -> None:
        """Record the mode, unless a failsafe has selected it."""
        if not self.state.failsafe:
            self._intended_mode = self.state.mode


class VehicleMission:
    """Adapter of the vehicle's mission for the mission protocol."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """Items of the loaded mission."""
        return self._vehicle.state.mission.items

    @property
    def progress(self) -> MissionProgress:
        """Values of MISSION_CURRENT."""
        return mission_progress(self._vehicle.state, self._vehicle.params.config)

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        """Replace the mission; return the MAV_MISSION_RESULT."""
        answer = self._vehicle.handle_request(requests.LoadMission(items))
        if answer.parameter:
            return MissionResult(missions.INVALID_PARAM1 + answer.parameter - 1)
        return MissionResult(_MISSION_RESULTS.get(answer.result, missions.DENIED))

    def set_current(self, sequence: int) -> bool:
        """Continue the mission at an item; return whether this was accepted."""
        return self._vehicle.handle_request(requests.SetMissionItem(sequence)).result == ACCEPTED

    def explain(self, text: str) -> None:
        """Send the reason of a refusal to ground."""
        self._vehicle.send_statustext(text)


_MISSION_RESULTS = {
    ACCEPTED: missions.ACCEPTED,
    DENIED: missions.INVALID,
    UNSUPPORTED: missions.UNSUPPORTED,
}


def mission_progress(state: AutopilotState, config: Config) -> MissionProgress:
    """Return the values of MISSION_CURRENT; the total does not count home where it is item 0."""
    mission_state, total = state.mission, len(state.mission.items)
    in_mission_mode = state.mode == modes.MISSION.number
    if not total:
        stage = NO_MISSION
    elif mission_state.current >= total:
        stage = COMPLETE
    elif in_mission_mode and state.armed:
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
