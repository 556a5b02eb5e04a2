"""The pure core with a memory: what the HIL loop ticks and what ground asks."""

from typing import NamedTuple

from autopilot import command, core, health, modes, requests
from autopilot.params import Config, ParamTable
from autopilot.types import (
    ACCEPTED,
    DENIED,
    UNSUPPORTED,
    Answer,
    Event,
    Inputs,
    ItemReached,
    Severity,
    State,
    Trace,
)
from link import missions
from link.mission_server import MissionProgress, Verdict
from link.missions import MissionItem
from link.records import ActuatorFrame, Altimeter, Battery, GpsFix, Leak, SensorFrame

FIX_LASTS_US = 1_500_000
"""A satellite fix older than this is none: the vehicle has dived."""

NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5
"""MISSION_STATE."""
NO_ITEMS = 0xFFFF
"""MISSION_CURRENT.total where there is no mission."""


class Snapshot(NamedTuple):
    """The vehicle after a tick, as telemetry tells it."""

    state: State
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
    """The autopilot's state, moved by ticks and by requests; gathers what there is to say of them."""

    def __init__(self, params: ParamTable) -> None:
        self.params, self.system = params, params.config.system_id
        self._events: list[Event | ItemReached] = []
        self._begin()

    def _begin(self) -> None:
        self.state = core.start()
        self._trace = Trace()
        self._sensors: SensorFrame | None = None
        self._fix: GpsFix | None = None
        self._altimeter: Altimeter | None = None
        self._battery: Battery | None = None
        self._leak: Leak | None = None
        self._intended_mode = self.state.mode
        self._actuators = core.actuators(self.state, self._trace, self.params.config)

    def tick(self, inputs: Inputs) -> ActuatorFrame:
        """One step at the vehicle time of the sensors."""
        self.state, self._actuators, self._trace, events = core.tick(self.state, inputs, self.params.config)
        self._sensors = inputs.sensors
        self._fix = inputs.gps or self._recent_fix()
        self._altimeter = inputs.altimeter or self._altimeter
        self._battery = inputs.battery or self._battery
        self._leak = inputs.leak or self._leak
        self._events += events
        self._follow_mode()
        return self._actuators

    def again(self) -> ActuatorFrame:
        """The last answer for a sensor frame that came twice; arming since then shows in it."""
        return core.actuators(self.state, self._trace, self.params.config)

    def request(self, wish: requests.Request) -> Answer:
        """Answer ground at once; a refusal is said aloud."""
        self.state, answer, events = command.request(self.state, wish, self.params.config)
        self._events += events
        if answer.result != ACCEPTED and answer.text:
            self.say(answer.text)
        self._follow_mode()
        return answer

    def restart(self, reason: str) -> None:
        """Begin afresh, as after a reboot; parameters and mission stay."""
        items = self.state.mission.items
        self._begin()
        self.state = command.request(self.state, requests.LoadMission(items), self.params.config)[0]
        self.say(f"Restarted: {reason}", Severity.NOTICE)

    def lose_sensors(self) -> None:
        """No sample comes any more: say so. Until they have come again for a while she is not to be armed."""
        self.state = health.lose_sensors(self.state)
        self.say("Sensors silent", Severity.ERROR)

    def say(self, text: str, severity: Severity = Severity.WARNING) -> None:
        """Tell every ground station."""
        self._events.append(Event(severity, text))

    def take_events(self) -> list[Event | ItemReached]:
        """What happened since the last call, in order."""
        events, self._events = self._events, []
        return events

    def snapshot(self) -> Snapshot:
        return Snapshot(
            self.state, self._trace, self._actuators, self._sensors, self._fix, self.params.config, self._intended_mode,
            self._altimeter, self._battery, self._leak,
        )  # fmt: skip

    def _recent_fix(self) -> GpsFix | None:
        fix = self._fix
        return fix if fix is not None and self.state.time_us - fix.time_us < FIX_LASTS_US else None

    def _follow_mode(self) -> None:
        if not self.state.failsafe:
            self._intended_mode = self.state.mode


class MissionStore:
    """The vehicle's mission as the mission protocol wants it."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    @property
    def items(self) -> tuple[MissionItem, ...]:
        return self._vehicle.state.mission.items

    @property
    def progress(self) -> MissionProgress:
        return progress(self._vehicle.state, self._vehicle.params.config)

    def load(self, items: tuple[MissionItem, ...]) -> Verdict:
        answer = self._vehicle.request(requests.LoadMission(items))
        return Verdict(_MISSION_RESULTS.get(answer.result, missions.DENIED))

    def set_current(self, sequence: int) -> bool:
        return self._vehicle.request(requests.SetMissionItem(sequence)).result == ACCEPTED

    def explain(self, text: str) -> None:
        self._vehicle.say(text)


_MISSION_RESULTS = {
    ACCEPTED: missions.ACCEPTED,
    DENIED: missions.INVALID,
    UNSUPPORTED: missions.UNSUPPORTED,
}


def progress(state: State, config: Config) -> MissionProgress:
    """How far the mission has come, as MISSION_CURRENT tells it: home, where it is item 0, counts for nothing."""
    mission, total = state.mission, len(state.mission.items)
    flying = state.mode == modes.MISSION.number
    if not total:
        stage = NO_MISSION
    elif mission.current >= total:
        stage = COMPLETE
    elif flying and state.armed:
        stage = ACTIVE
    else:
        stage = PAUSED if mission.reached >= 0 else NOT_STARTED
    counted = total - config.mission_seq0_home if total else NO_ITEMS
    return MissionProgress(min(mission.current, max(0, total - 1)), counted, stage, 1 if flying else 2)
