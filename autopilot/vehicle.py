"""The pure core with a memory: what the HIL loop ticks and what ground asks."""

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

MAX_TRIM_REPORTS = 2.0
"""Trims are kept after so many times the time in which they are learned."""
FIX_TIMEOUT_US = 1_500_000
"""A satellite fix older than this is none: the vehicle has dived."""

NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5
"""MISSION_STATE."""
NO_ITEMS = 0xFFFF
"""MISSION_CURRENT.total where there is no mission."""


class Snapshot(NamedTuple):
    """The vehicle after a tick, as telemetry tells it."""

    state: AutopilotState
    trace: Trace
    actuators: ActuatorFrame
    sensors: SensorFrame | None
    fix: GpsFix | None
    """The satellite fix of the last moments, None under water."""
    config: Config
    intended_mode: int
    """The mode that was last asked for; a failsafe may have put another in force."""
    altimeter: Altimeter | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    """Each the newest, None before the first."""


class Vehicle:
    """The autopilot's state, moved by ticks and by requests; gathers what there is to say of
    them."""

    def __init__(self, params: ParamTable) -> None:
        self.params, self.system = params, params.config.system_id
        self._events: list[Event | ItemReached] = []
        self._begin()

    def _begin(self) -> None:
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
        """One step at the vehicle time of the sensors."""
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
        self._follow_mode()
        if before.armed and not self.state.armed:
            self._keep_trim(before.loops.trim)
        return self._actuators

    def again(self) -> ActuatorFrame:
        """The last answer for a sensor frame that came twice; arming since then shows in it."""
        return core.actuator_frame(self.state, self._trace, self.params.config)

    def request(self, wish: requests.Request) -> Answer:
        """Answer ground at once; a refusal is said aloud."""
        before = self.state
        self.state, answer, events = request_handler.handle_request(
            before, wish, self.params.config
        )
        self._events += events
        if before.armed and not self.state.armed:
            self._keep_trim(before.loops.trim)
        if answer.result != ACCEPTED and answer.text:
            self.say(answer.text)
        self._follow_mode()
        return answer

    def restart(self, reason: str) -> None:
        """Begin afresh, as after a reboot; parameters and mission stay."""
        items = self.state.mission.items
        self._begin()
        loaded = mission.restart(MissionState(items), self.params.config)
        self.state = self.state._replace(mission=loaded)
        self.say(f"Restarted: {reason}", Severity.NOTICE)

    def lose_sensors(self) -> None:
        """No sample comes any more: say so. Until they have come again for a while she is not to be
        armed."""
        self.state = monitor.report_sensor_loss(self.state)
        self.say("Sensor timeout", Severity.ERROR)

    def say(self, text: str, severity: Severity = Severity.WARNING) -> None:
        """Tell every ground station."""
        self._events.append(Event(severity, text))

    def take_events(self) -> list[Event | ItemReached]:
        """What happened since the last call, in order."""
        events, self._events = self._events, []
        return events

    def snapshot(self) -> Snapshot:
        return Snapshot(
            self.state,
            self._trace,
            self._actuators,
            self._sensors,
            self._fix,
            self.params.config,
            self._intended_mode,
            self._altimeter,
            self._battery,
            self._leak,
        )

    def _keep_trim(self, trim: Trim) -> None:
        """Trims that were learned for long enough become parameters when the vehicle is
        disarmed."""
        config = self.params.config
        if not config.trim_time_s or trim.learned_s < MAX_TRIM_REPORTS * config.trim_time_s:
            return
        learned = {
            "TRIM_RUD_DEG": config.rudder_trim_deg + math.degrees(trim.rudder_rad),
            "TRIM_ELE_DEG": config.elevator_trim_deg + math.degrees(trim.elevator_rad),
        }
        try:
            kept = [
                f"{name} {self.params.set(name, round(value, 3)):g}"
                for name, value in learned.items()
            ]
        except ParamError as error:
            self.say(f"Trim not kept: {error}")
            return
        self.say(f"Trim learned: {', '.join(kept)}", Severity.NOTICE)

    def _recent_fix(self) -> GpsFix | None:
        fix = self._fix
        return (
            fix if fix is not None and self.state.time_us - fix.time_us < FIX_TIMEOUT_US else None
        )

    def _follow_mode(self) -> None:
        if not self.state.failsafe:
            self._intended_mode = self.state.mode


class VehicleMission:
    """The vehicle's mission as the mission protocol wants it."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    @property
    def items(self) -> tuple[MissionItem, ...]:
        return self._vehicle.state.mission.items

    @property
    def progress(self) -> MissionProgress:
        return progress(self._vehicle.state, self._vehicle.params.config)

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        answer = self._vehicle.request(requests.LoadMission(items))
        if answer.parameter:
            return MissionResult(missions.INVALID_PARAM1 + answer.parameter - 1)
        return MissionResult(_MISSION_RESULTS.get(answer.result, missions.DENIED))

    def set_current(self, sequence: int) -> bool:
        return self._vehicle.request(requests.SetMissionItem(sequence)).result == ACCEPTED

    def explain(self, text: str) -> None:
        self._vehicle.say(text)


_MISSION_RESULTS = {
    ACCEPTED: missions.ACCEPTED,
    DENIED: missions.INVALID,
    UNSUPPORTED: missions.UNSUPPORTED,
}


def progress(state: AutopilotState, config: Config) -> MissionProgress:
    """How far the mission has come, as MISSION_CURRENT tells it: home, where it is item 0, counts
    for nothing."""
    flown, total = state.mission, len(state.mission.items)
    flying = state.mode == modes.MISSION.number
    if not total:
        stage = NO_MISSION
    elif flown.current >= total:
        stage = COMPLETE
    elif flying and state.armed:
        stage = ACTIVE
    else:
        stage = PAUSED if flown.reached >= 0 else NOT_STARTED
    counted = total - config.mission_seq0_home if total else NO_ITEMS
    return MissionProgress(
        min(flown.current, max(0, total - 1)), counted, stage, 1 if flying else 2
    )
