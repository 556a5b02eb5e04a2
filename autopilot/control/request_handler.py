"""Answers a ground station's wishes at once: pure, like the tick, and between two ticks."""

from autopilot.control import (
    actuator_test,
    excitation,
    failsafe,
    guidance,
    mission,
    modes,
    navigation,
    requests,
)
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor
from autopilot.control.setpoints import AttitudeTarget, Circle, TrackLine
from autopilot.control.types import (
    ACCEPTED,
    DENIED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Answer,
    AutopilotState,
    Event,
    Home,
    ItemReached,
    LoopMemory,
    MissionState,
    Severity,
)
from mavlink_io.mission_items import MissionItem

Events = tuple[Event | ItemReached, ...]


def handle_request(
    state: AutopilotState, wish: requests.Request, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Answer a ground station at once: the new state, what became of the wish, what to say of
    it."""
    match wish:
        case requests.Arm(force):
            return arm(state, force, config)
        case requests.Disarm(force):
            return disarm(state, force, config)
        case requests.SetMode(number):
            return set_mode(state, number, config)
        case requests.StartTest():
            return start_test(state, wish, config)
        case requests.StopTest():
            stopped: Events = (
                (Event(Severity.NOTICE, "SystemID Stopped: by ground"),) if state.test else ()
            )
            return state._replace(test=None), Answer(ACCEPTED), stopped
        case requests.LoadMission(items):
            return load_mission(state, items, config)
        case requests.SetMissionItem(sequence):
            if not 0 <= sequence < max(1, len(state.mission.items)):
                return state, Answer(DENIED, f"Mission item {sequence} does not exist"), ()
            moved = state.mission._replace(current=sequence, entered_us=None)
            return state._replace(mission=moved, test=None, path=None), Answer(ACCEPTED), ()
        case requests.ChangeTarget():
            return change_target(state, wish), Answer(ACCEPTED), ()
        case requests.TestActuator():
            return test_actuator(state, wish)
        case requests.SetTarget():
            return set_target(state, wish), Answer(ACCEPTED), ()
        case requests.SetHome(lat_deg, lon_deg):
            return set_home(state, Home(lat_deg, lon_deg, True)), Answer(ACCEPTED), ()


def arm(
    state: AutopilotState, force: bool, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    if state.armed:
        return state, Answer(ACCEPTED), ()
    reason = prearm(state, config)
    if reason and not force:
        return state, Answer(TEMPORARILY_REJECTED, f"Not armed: {reason}"), ()
    state = state._replace(
        armed=True,
        armed_us=state.time_us,
        failsafe="",
        loops=LoopMemory(),
        test=None,
        actuator_tests=(),
    )
    state = state._replace(mission=_start_from_here(state, config))
    mode = modes.by_number(state.mode) or modes.HOLD
    return (
        guidance.hold_current(state, config),
        Answer(ACCEPTED),
        (Event(Severity.INFO, f"Armed: {mode.name}"),),
    )


def _start_from_here(state: AutopilotState, config: Config) -> MissionState:
    """Where the mission takes up: where ground put it, or from the start when it was flown to its
    end."""
    if state.mission.current < len(state.mission.items):
        return state.mission._replace(entered_us=None)
    return mission.restart(state.mission, config)


def prearm(state: AutopilotState, config: Config) -> str:
    """Why the vehicle must not be armed; empty when it may."""
    if not state.estimate.initialised:
        return "no sensors"
    if reason := monitor.prearm_failure(state.health):
        return reason
    return missing_requirement(state, modes.by_number(state.mode) or modes.HOLD, config)


def missing_requirement(state: AutopilotState, mode: modes.Mode, config: Config) -> str:
    """What a mode cannot be flown without; empty when all is there.

    A mission of latitudes and longitudes may be uploaded before home is known, but not flown.
    """
    if mode == modes.MISSION and not state.mission.items:
        return "no mission"
    if mode == modes.MISSION and (
        fault := mission.find_fault(state.mission.items, state.home, config)
    ):
        return f"mission item {fault.sequence}: {fault.reason}"
    if mode == modes.RTL or (
        mode == modes.MISSION and mission.needs_home(state.mission.items, config)
    ):
        return "" if state.home.known else "home is not known"
    if mode == modes.OFFBOARD and not any(state.targets):
        return "no set-point streams"
    return ""


def disarm(
    state: AutopilotState, force: bool, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    if not state.armed:
        return state, Answer(ACCEPTED), ()
    if (
        not force
        and state.estimate.depth_m > config.surfaced_depth_m
        and state.mode != modes.MANUAL.number
    ):
        return (
            state,
            Answer(TEMPORARILY_REJECTED, "Not disarmed: under water; use SURFACE, or force"),
            (),
        )
    return modes.disarm(state), Answer(ACCEPTED), (Event(Severity.INFO, "Disarmed"),)


def set_mode(
    state: AutopilotState, number: int, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    mode = modes.by_number(number)
    if mode is None:
        known = ", ".join(m.name for m in modes.MODES)
        return state, Answer(UNSUPPORTED, f"Mode {number} is none of {known}"), ()
    if number == state.mode:
        return state, Answer(ACCEPTED), ()
    if state.failsafe == failsafe.GCS_LOST:
        state = state._replace(failsafe="")  # whoever asks is back
    if state.failsafe and state.armed and mode not in (modes.SURFACE, modes.MANUAL):
        return (
            state,
            Answer(TEMPORARILY_REJECTED, f"{mode.name} refused: failsafe, {state.failsafe}"),
            (),
        )
    if state.armed and (reason := missing_requirement(state, mode, config)):
        return state, Answer(TEMPORARILY_REJECTED, f"{mode.name} refused: {reason}"), ()
    if mode == modes.SYSID:
        return start_test(state, excitation.from_config(config), config)
    state, events = modes.enter(state, mode)
    if mode == modes.MISSION:
        state = state._replace(mission=_start_from_here(state, config))
    if state.armed:
        state = guidance.hold_current(state, config)
    return state, Answer(ACCEPTED), events


def set_target(state: AutopilotState, wish: requests.SetTarget) -> AutopilotState:
    """Keep the newest set-point of its kind; OFFBOARD follows it."""
    if isinstance(wish.target, AttitudeTarget):
        return state._replace(targets=state.targets._replace(attitude=wish.target))
    return state._replace(targets=state.targets._replace(motion=wish.target))


def set_home(state: AutopilotState, home: Home) -> AutopilotState:
    """Count from a new home; she stays where she is, and so do the ends of her path."""
    shift = navigation.shift_home(0j, state.home, home)
    at, path = state.estimate, state.path
    estimate = at._replace(north_m=at.north_m + shift.real, east_m=at.east_m + shift.imag)
    if isinstance(path, TrackLine):
        to_m = 0j if state.mode == modes.RTL.number else path.to_m + shift
        path = path._replace(from_m=path.from_m + shift, to_m=to_m)
    if isinstance(path, Circle):
        path = path._replace(centre_m=path.centre_m + shift)
    previous_waypoint_m = state.mission.previous_waypoint_m
    mission_state = state.mission._replace(
        previous_waypoint_m=None if previous_waypoint_m is None else previous_waypoint_m + shift
    )
    return state._replace(home=home, estimate=estimate, path=path, mission=mission_state)


def start_test(
    state: AutopilotState, wish: requests.StartTest, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    test = excitation.precompute(wish, state, config)
    if wrong := excitation.check(test, config.travel_deg):
        return state, Answer(DENIED, f"SystemID refused: {wrong}"), ()
    if not state.armed or state.failsafe:
        return (
            state,
            Answer(TEMPORARILY_REJECTED, "SystemID refused: arm and get under way first"),
            (),
        )
    if state.mode == modes.SYSID.number and state.test is not None:
        return state, Answer(TEMPORARILY_REJECTED, "SystemID refused: a test is running"), ()
    state, changed = modes.enter(state, modes.SYSID)
    state, started = mission.start_test(test, state)
    return state, Answer(ACCEPTED), (*changed, *started)


def test_actuator(
    state: AutopilotState, wish: requests.TestActuator
) -> tuple[AutopilotState, Answer, Events]:
    if state.armed:
        return state, Answer(TEMPORARILY_REJECTED, "Actuator test refused: armed"), ()
    return actuator_test.begin(state, wish.channel, wish.value, wish.seconds), Answer(ACCEPTED), ()


def load_mission(
    state: AutopilotState, items: tuple[MissionItem, ...], config: Config
) -> tuple[AutopilotState, Answer, Events]:
    if fault := mission.find_fault(items, state.home, config):
        result = DENIED if items[fault.sequence].command in mission.COMMANDS else UNSUPPORTED
        return (
            state,
            Answer(result, f"Mission item {fault.sequence}: {fault.reason}", fault.parameter),
            (),
        )
    if state.armed and state.mode == modes.MISSION.number:
        return state, Answer(TEMPORARILY_REJECTED, "Mission refused: one is being flown"), ()
    return (
        state._replace(mission=mission.restart(MissionState(items), config)),
        Answer(ACCEPTED),
        (),
    )


def change_target(state: AutopilotState, wish: requests.ChangeTarget) -> AutopilotState:
    old = state.setpoint
    return state._replace(
        setpoint=old._replace(
            depth_m=old.depth_m if wish.depth_m is None else wish.depth_m,
            heading_rad=old.heading_rad if wish.heading_rad is None else wish.heading_rad,
            thrust=old.thrust if wish.thrust is None else wish.thrust,
        )
    )
