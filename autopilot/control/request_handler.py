"""Handling of ground station requests, between two ticks. Pure."""

import math
from dataclasses import replace

from autopilot.control import (
    actuator_test,
    excitation,
    failsafe,
    feasibility,
    fence,
    guidance,
    mission,
    modes,
    navigation,
    offboard,
    requests,
)
from autopilot.control.params import Config, find_conflict
from autopilot.control.sensor_health import monitor
from autopilot.control.setpoints import AttitudeTarget, Circle, TrackLine
from autopilot.control.types import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Answer,
    AutopilotState,
    Event,
    Events,
    Home,
    LoopMemory,
    MissionState,
    Severity,
)
from mavlink_io.mission_items import GLOBAL_FRAMES, MavCmd, MissionItem


def handle_request(
    state: AutopilotState, request: requests.Request, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Handle a request of a ground station.

    Parameters
    ----------
    state : AutopilotState
        Present state.
    request : Request
        Request.
    config : Config
        Parameters.

    Returns
    -------
    tuple[AutopilotState, Answer, Events]
        New state, result to send to the ground station, and events.
    """
    match request:
        case requests.Arm(force):
            return arm(state, force, config)
        case requests.Disarm(force):
            return disarm(state, force, config)
        case requests.SetMode(number):
            return set_mode(state, number, config)
        case requests.StartTest():
            return start_test(state, request, config)
        case requests.StopTest():
            return state._replace(test=None), Answer(ACCEPTED), _test_stopped(state)
        case requests.LoadMission(items):
            return load_mission(state, items, config)
        case requests.LoadFence(items):
            return load_fence(state, items, config)
        case requests.LoadRally(items):
            return load_rally(state, items)
        case requests.SetMissionItem():
            return set_mission_item(state, request, config)
        case requests.ChangeTarget():
            return change_target(state, request), Answer(ACCEPTED), ()
        case requests.TestActuator():
            return test_actuator(state, request)
        case requests.GoTo():
            return go_to(state, request, config)
        case requests.SetTarget():
            return set_target(state, request, config)
        case requests.SetHome(lat_deg, lon_deg):
            return set_home(state, Home(lat_deg, lon_deg, known=True)), Answer(ACCEPTED), ()


def arm(
    state: AutopilotState, force: bool, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Arm the vehicle if the pre-arm checks pass or ``force`` is set."""
    if state.armed:
        return state, Answer(ACCEPTED), ()
    reason = prearm(state, config)
    if reason and not force:
        return state, Answer(TEMPORARILY_REJECTED, f"Not armed: {reason}"), ()
    state = state._replace(
        armed=True,
        armed_us=state.time_us,
        health=monitor.begin_dive(state.health, state.ahrs.frame),
        failsafe="",
        loops=LoopMemory(),
        test=None,
        actuator_tests=(),
        rest=None,
    )
    state = state._replace(mission=_resume_mission(state, config))
    mode = modes.by_number(state.mode) or modes.HOLD
    return (
        guidance.hold_current(state, config),
        Answer(ACCEPTED),
        (Event(Severity.INFO, f"Armed: {mode.name}"),),
    )


def _resume_mission(state: AutopilotState, config: Config) -> MissionState:
    """Return the mission at its current item; at its first item if it was completed."""
    if state.mission.current < len(state.mission.items):
        return state.mission._replace(entered_us=None)
    return mission.restart(state.mission, config)


def prearm(state: AutopilotState, config: Config) -> str:
    """Return the reason why the vehicle must not be armed; empty if the checks pass."""
    if not state.estimate.initialised:
        return "no sensors"
    if reason := monitor.prearm_failure(state.health):
        return reason
    if conflict := find_conflict(config):
        return conflict
    if state.fence.zones and config.fence_action:
        if not state.home.known:
            return "home is not known, and there is a geofence"
        if text := failsafe.fence_breach(state, config, ahead=False):
            return f"geofence: {text}"
    return missing_requirement(state, modes.by_number(state.mode) or modes.HOLD, config)


def missing_requirement(state: AutopilotState, mode: modes.Mode, config: Config) -> str:
    """Return the first requirement of a mode that is not met; empty if all are.

    A mission with latitudes and longitudes can be uploaded before home is known, but not flown.
    """
    if mode == modes.MISSION and not state.mission.items:
        return "no mission"
    if mode == modes.MISSION and (
        fault := feasibility.find_fault(
            state, state.mission.items, config, feasibility.start_of(state)
        )
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
    """Disarm the vehicle; while submerged only in MANUAL or if ``force`` is set."""
    if not state.armed:
        return state._replace(rest=None), Answer(ACCEPTED), ()
    submerged = state.estimate.depth_m > config.surfaced_depth_m
    if submerged and not force and state.mode != modes.MANUAL.number:
        return (
            state,
            Answer(TEMPORARILY_REJECTED, "Not disarmed: under water; use SURFACE, or force"),
            (),
        )
    ended, events = (state, ()) if submerged else mission.end_at_surface(state)
    return modes.disarm(ended), Answer(ACCEPTED), (*events, Event(Severity.INFO, "Disarmed"))


def set_mode(
    state: AutopilotState, number: int, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Change the mode if its requirements are met and no failsafe forbids it."""
    mode = modes.by_number(number)
    if mode is None:
        known = ", ".join(m.name for m in modes.MODES)
        return state, Answer(UNSUPPORTED, f"Mode {number} is none of {known}"), ()
    state = _end_ground_loss(state)
    if number == state.mode:
        return state, Answer(ACCEPTED), ()
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
        state = state._replace(mission=_resume_mission(state, config))
    if state.armed:
        state = guidance.hold_current(state, config)
    return state, Answer(ACCEPTED), events


def _end_ground_loss(state: AutopilotState) -> AutopilotState:
    """Return the state without the failsafe of a lost ground: its requests arrive again."""
    return state._replace(failsafe="") if state.failsafe == failsafe.GCS_LOST else state


def _test_stopped(state: AutopilotState) -> Events:
    """Return the event of a test that a request ends; none without a test."""
    return (Event(Severity.NOTICE, "SystemID Stopped: by ground"),) if state.test else ()


def set_mission_item(
    state: AutopilotState, request: requests.SetMissionItem, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Continue the mission at an item, with a reset if requested.

    The reset of a completed mission without an item selects its first item to fly. Path and test
    of another mode are none of the mission's.
    """
    plan, sequence = state.mission, request.sequence
    if sequence is not None and not 0 <= sequence < max(1, len(plan.items)):
        return state, Answer(FAILED, f"Mission item {sequence} does not exist"), ()
    if request.reset:
        if sequence is None and plan.current >= len(plan.items):
            sequence = mission.restart(plan, config).current
        plan = plan._replace(jumps=())
    if sequence is None:
        return state._replace(mission=plan), Answer(ACCEPTED), ()
    state = state._replace(mission=plan._replace(current=sequence, entered_us=None))
    if state.mode != modes.MISSION.number:
        return state, Answer(ACCEPTED), ()
    return state._replace(test=None, path=None), Answer(ACCEPTED), _test_stopped(state)


def set_target(
    state: AutopilotState, request: requests.SetTarget, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Store the latest target of a stream; in STATION its place is circled, its depth taken."""
    target = request.target
    if isinstance(target, AttitudeTarget):
        targets = state.targets._replace(attitude=target)
        return state._replace(targets=targets), Answer(ACCEPTED), ()
    stored = state._replace(targets=state.targets._replace(motion=target))
    there = requests.go_to_target(target)
    if state.armed and state.mode == modes.STATION.number and there is not None:
        return go_to(stored, there, config)
    return stored, Answer(ACCEPTED), ()


def go_to(
    state: AutopilotState, request: requests.GoTo, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Circle a place in STATION, or change the depth, within the limits of a mission item."""
    item, mode = request.item, modes.by_number(state.mode) or modes.HOLD
    result, reason = _go_to_refusal(state, request, config)
    if reason:
        return state, Answer(result, f"Go-to refused: {reason}"), ()
    circles = item.command == MavCmd.NAV_LOITER_UNLIM
    stays = mode == modes.STATION or (mode == modes.HOLD and not circles)
    wanted = modes.STATION if circles or mode == modes.STATION else modes.HOLD
    present = state.setpoint
    state, answer, events = set_mode(state, wanted.number, config)
    if answer.result != ACCEPTED:
        return state, answer, events
    depth_m = present.depth_m if mode in (modes.HOLD, modes.STATION) else state.setpoint.depth_m
    thrust = present.thrust if stays else state.setpoint.thrust
    if request.speed_mps is not None:
        thrust = offboard.thrust_for(request.speed_mps, config)
    setpoint = state.setpoint._replace(
        depth_m=guidance.item_depth_m(item, depth_m), thrust=thrust, pitch_rad=math.nan
    )
    state = state._replace(setpoint=setpoint)
    return (_circle_place(state, item, config) if circles else state), answer, events


def _go_to_refusal(
    state: AutopilotState, request: requests.GoTo, config: Config
) -> tuple[int, str]:
    """Return MAV_RESULT and reason if a place or a depth is refused; no reason if it is not."""
    item = request.item
    if not state.armed:
        return TEMPORARILY_REJECTED, "not armed"
    mode = modes.by_number(state.mode) or modes.HOLD
    if mode not in (modes.HOLD, modes.STATION) and not request.changes_mode:
        return TEMPORARILY_REJECTED, f"mode {mode.name}; set the change-mode flag, or HOLD first"
    has_place = item.command == MavCmd.NAV_LOITER_UNLIM
    if has_place and item.frame in GLOBAL_FRAMES and not state.home.known:
        return TEMPORARILY_REJECTED, "home is not known"
    items, config = (item,), replace(config, mission_seq0_home=0)
    fault = mission.find_fault(items, state.home, config) or feasibility.find_fence_fault(
        items, state.fence, state.home, config
    )
    return (DENIED, fault.reason) if fault else (ACCEPTED, "")


def _circle_place(state: AutopilotState, item: MissionItem, config: Config) -> AutopilotState:
    """Set the path to the circle of an item; a repeated request does not restart it."""
    place_m = guidance.item_position(item, state.home)
    centre_m = guidance.position_of(state.estimate) if place_m is None else place_m
    path = guidance.circle(centre_m, item.p3, config)
    old = state.path
    same = isinstance(old, Circle) and old[:3] == path[:3]
    return state if same else state._replace(path=path)


def set_home(state: AutopilotState, home: Home) -> AutopilotState:
    """Set home. The vehicle, its path and the last waypoint keep their places over ground.

    In RTL the path ends at the new home.
    """
    shift = navigation.shift_home(0j, state.home, home)
    old, path = state.estimate, state.path
    estimate = old._replace(north_m=old.north_m + shift.real, east_m=old.east_m + shift.imag)
    if isinstance(path, TrackLine):
        returning_home = state.mode == modes.RTL.number and path.to_m == 0j
        to_m = 0j if returning_home else path.to_m + shift
        path = path._replace(from_m=path.from_m + shift, to_m=to_m)
    if isinstance(path, Circle):
        path = path._replace(centre_m=path.centre_m + shift)
    previous_waypoint_m = state.mission.previous_waypoint_m
    mission_state = state.mission._replace(
        previous_waypoint_m=None if previous_waypoint_m is None else previous_waypoint_m + shift
    )
    return state._replace(home=home, estimate=estimate, path=path, mission=mission_state)


def start_test(
    state: AutopilotState, request: requests.StartTest, config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Start a test in mode SYSID if the test is valid and the vehicle is armed."""
    test = excitation.precompute(request, state, config)
    if fault := excitation.check(test, config.travel_deg):
        return state, Answer(DENIED, f"SystemID refused: {fault}"), ()
    if not state.armed or state.failsafe:
        return (
            state,
            Answer(TEMPORARILY_REJECTED, "SystemID refused: arm and get under way first"),
            (),
        )
    if state.mode == modes.SYSID.number and state.test is not None:
        return state, Answer(TEMPORARILY_REJECTED, "SystemID refused: a test is running"), ()
    state, mode_events = modes.enter(state, modes.SYSID)
    state, test_events = mission.start_test(test, state)
    return state, Answer(ACCEPTED), (*mode_events, *test_events)


def test_actuator(
    state: AutopilotState, request: requests.TestActuator
) -> tuple[AutopilotState, Answer, Events]:
    """Start a test of one actuator if the vehicle is disarmed."""
    if state.armed:
        return state, Answer(TEMPORARILY_REJECTED, "Actuator test refused: armed"), ()
    return (
        actuator_test.begin(state, request.channel, request.value, request.seconds),
        Answer(ACCEPTED),
        (),
    )


def load_fence(
    state: AutopilotState, items: tuple[MissionItem, ...], config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Replace the geofence; while armed only by one that allows the present position."""
    new = fence.parse_fence(items)
    if isinstance(new, fence.PlanFault):
        return state, _plan_refusal("Fence", new), ()
    changed = state._replace(fence=new)
    if state.armed and (text := failsafe.fence_breach(changed, config, ahead=False)):
        return state, Answer(TEMPORARILY_REJECTED, f"Fence refused: the vehicle is {text}"), ()
    return changed, Answer(ACCEPTED), ()


def load_rally(
    state: AutopilotState, items: tuple[MissionItem, ...]
) -> tuple[AutopilotState, Answer, Events]:
    """Replace the rally points."""
    new = fence.parse_rally(items)
    if isinstance(new, fence.PlanFault):
        return state, _plan_refusal("Rally", new), ()
    return state._replace(rally=new), Answer(ACCEPTED), ()


def _plan_refusal(plan: str, fault: fence.PlanFault) -> Answer:
    """Return the answer to a plan with a fault."""
    result = UNSUPPORTED if fault.unknown else DENIED
    return Answer(result, f"{plan} item {fault.sequence}: {fault.reason}", fault.parameter)


def load_mission(
    state: AutopilotState, items: tuple[MissionItem, ...], config: Config
) -> tuple[AutopilotState, Answer, Events]:
    """Replace the mission if all its items can be flown and none is in progress."""
    if fault := feasibility.find_fault(state, items, config, None):
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


def change_target(state: AutopilotState, request: requests.ChangeTarget) -> AutopilotState:
    """Return the state with the set-points of a request."""
    old = state.setpoint
    return _end_ground_loss(state)._replace(
        setpoint=old._replace(
            depth_m=old.depth_m if request.depth_m is None else request.depth_m,
            heading_rad=old.heading_rad if request.heading_rad is None else request.heading_rad,
            thrust=old.thrust if request.thrust is None else request.thrust,
        )
    )
