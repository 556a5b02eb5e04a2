"""Flies the uploaded items: each begins once, then is asked every tick whether it is done."""

import math
from bisect import bisect_left
from typing import NamedTuple

from autopilot.control import excitation, guidance, modes, offboard
from autopilot.control.params import Config
from autopilot.control.setpoints import Circle, TrackLine
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Event,
    Excitation,
    Home,
    ItemReached,
    MissionState,
    Severity,
)
from mavlink_io.frames import wrap_pi
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    GLOBAL_FRAMES,
    MavCmd,
    MissionItem,
    place_fault,
)

COMMANDS = frozenset(
    (
        MavCmd.NAV_WAYPOINT,
        MavCmd.NAV_LOITER_UNLIM,
        MavCmd.NAV_LOITER_TURNS,
        MavCmd.NAV_LOITER_TIME,
        MavCmd.NAV_RETURN_TO_LAUNCH,
        MavCmd.NAV_LAND,
        MavCmd.NAV_DELAY,
        MavCmd.CONDITION_CHANGE_ALT,
        MavCmd.CONDITION_YAW,
        MavCmd.DO_JUMP,
        MavCmd.DO_CHANGE_SPEED,
        MavCmd.DO_CHANGE_ALTITUDE,
        MavCmd.USER_1,
    )
)
"""Commands that a mission item may carry."""

DEPTH_REACHED_M = 0.3
DEPTH_ROUNDING_M = 1e-3
"""Rounding of a depth in a float32: half of 0.5 mm at the 6000 m that FS_DEPTH_M may be at most."""
ITEMS_PER_TICK = 10
"""Items, jumps among them, that a tick may complete; the next tick goes on. Jumps in a circle would
otherwise delay every tick."""

_POSITION_COMMANDS = frozenset(
    (
        MavCmd.NAV_WAYPOINT,
        MavCmd.NAV_LOITER_UNLIM,
        MavCmd.NAV_LOITER_TURNS,
        MavCmd.NAV_LOITER_TIME,
        MavCmd.NAV_LAND,
    )
)
"""Items that may give a place."""
_DEPTH_COMMANDS = _POSITION_COMMANDS | {MavCmd.CONDITION_CHANGE_ALT}
"""Items whose z is a depth or an altitude."""

StepResult = tuple[AutopilotState, tuple[Event | ItemReached, ...]]


_FIELDS = {"p1": 1, "p2": 2, "p3": 3, "p4": 4, "z": 7}
"""The parameters of an item that are real numbers, with their numbers in MAV_MISSION_RESULT."""

Wrong = tuple[int, str]
"""The number of a parameter (0: none in particular) and what is wrong with it, "" for nothing."""


class Fault(NamedTuple):
    """Why a mission cannot be flown."""

    sequence: int
    reason: str
    """With the value and the limit."""
    parameter: int = 0
    """1 to 7; 0 for none in particular."""


def check(items: tuple[MissionItem, ...], config: Config) -> tuple[int, str]:
    """The first item that this vehicle cannot fly and why; (-1, "") when it can fly them all."""
    fault = find_fault(items, Home(), config)
    return (-1, "") if fault is None else fault[:2]


def find_fault(items: tuple[MissionItem, ...], home: Home, config: Config) -> Fault | None:
    """Return the first item that cannot be flown from home, None when all can be.

    Checked when a mission is loaded and again when it is started: home and limits may have changed.
    """
    for item in _items_to_fly(items, config):
        parameter, reason = _item_fault(item, len(items), config)
        if not reason:
            parameter, reason = _out_of_reach(item, home, config)
        if reason:
            return Fault(item.sequence, reason, parameter)
    return None


_REQUIRED_PARAMETERS: dict[int, tuple[str, ...]] = {
    MavCmd.NAV_DELAY: ("p1",),
    MavCmd.NAV_LOITER_TIME: ("p1",),
    MavCmd.NAV_LOITER_TURNS: ("p1",),
    MavCmd.CONDITION_YAW: ("p1",),
    MavCmd.DO_JUMP: ("p1", "p2"),
    MavCmd.DO_CHANGE_ALTITUDE: ("p1",),
    MavCmd.CONDITION_CHANGE_ALT: ("z",),
    MavCmd.USER_1: ("p1", "p2"),
}
"""The numbers without which an item means nothing; NaN in any other field means "not given"."""


def _item_fault(item: MissionItem, count: int, config: Config) -> Wrong:
    """What is wrong with an item wherever the vehicle is."""
    if item.command not in COMMANDS:
        return 0, f"command {item.command} is not one this vehicle flies"
    for name in _REQUIRED_PARAMETERS.get(item.command, ()):
        if not math.isfinite(getattr(item, name)):
            return _FIELDS[name], f"{name} of command {item.command}: must be a number"
    for name, parameter in _FIELDS.items():
        if math.isinf(getattr(item, name)):
            return parameter, f"{name} of command {item.command}: must be finite"
    if item.command == MavCmd.DO_JUMP and not 0 <= item.p1 < count:
        return 1, f"DO_JUMP to {item.p1:g}: there is no such item"
    if item.command == MavCmd.DO_CHANGE_ALTITUDE and item.p1 > 0.0:
        return 1, f"altitude {item.p1:g} m: must be 0 or negative, depth is minus altitude"
    if item.command in _DEPTH_COMMANDS and guidance.item_depth_m(item, 0.0) < 0.0:
        depth_m = guidance.item_depth_m(item, 0.0)
        return 7, f"depth {depth_m:g} m: must be 0 or more; z is down in a local frame, else up"
    if item.command in _DEPTH_COMMANDS or item.command == MavCmd.DO_CHANGE_ALTITUDE:
        depth_m, limit_m = _new_depth_m(item), config.fs_depth_m
        if depth_m > limit_m + DEPTH_ROUNDING_M:
            parameter = 7 if item.command in _DEPTH_COMMANDS else 1
            return parameter, f"depth {depth_m:g} m: must be at most FS_DEPTH_M = {limit_m:g} m"
    if item.command in _POSITION_COMMANDS:
        return place_fault(item)
    if item.command == MavCmd.USER_1:
        return 0, excitation.check(excitation_of(item, AutopilotState(), config), config.travel_deg)
    return 0, ""


def _out_of_reach(item: MissionItem, home: Home, config: Config) -> Wrong:
    """Whether the place of an item is too far from home, as far as home is known."""
    limit_m = config.mission_distance_m
    if (
        limit_m == 0.0
        or item.command not in _POSITION_COMMANDS
        or not (home.known or item.frame == FRAME_LOCAL_NED)
    ):
        return 0, ""
    place_m = guidance.item_position(item, home)
    if place_m is None or abs(place_m) <= limit_m:
        return 0, ""
    parameter = 5 if abs(place_m.real) >= abs(place_m.imag) else 6
    return (
        parameter,
        f"{abs(place_m):.0f} m from home: must be at most MIS_DIST_MAX = {limit_m:g} m",
    )


def needs_home(items: tuple[MissionItem, ...], config: Config) -> bool:
    """Whether an item that is flown is told by latitude and longitude, or is the way home."""
    return any(
        item.command == MavCmd.NAV_RETURN_TO_LAUNCH
        or (
            item.command in _POSITION_COMMANDS
            and item.frame in GLOBAL_FRAMES
            and guidance.item_position(item, Home()) is not None
        )
        for item in _items_to_fly(items, config)
    )


def restart(mission: MissionState, config: Config) -> MissionState:
    """The same items from their first."""
    first = len(mission.items) - len(_items_to_fly(mission.items, config))
    return MissionState(mission.items, first)


def step(state: AutopilotState, config: Config) -> StepResult:
    """Begin and finish as many items as this tick allows."""
    events: list[Event | ItemReached] = []
    for _ in range(ITEMS_PER_TICK):
        mission = state.mission
        if mission.current >= len(mission.items):
            state, ended = _complete(state, config)
            return state, (*events, *ended)
        item = mission.items[mission.current]
        if mission.entered_us is None:
            state, begun = begin_item(item, state, config)
            events += begun
        state = _start_waypoint_orbit(item, state, config)
        if state.mode != modes.MISSION.number or not item_done(item, state, config):
            break
        if item.command == MavCmd.NAV_LAND:
            state, surfacing = modes.enter(state, modes.SURFACE)
            return state, (*events, *surfacing)
        state = _advance_item(item, state)
        events.append(ItemReached(item.sequence))
    return state, tuple(events)


def begin_item(item: MissionItem, state: AutopilotState, config: Config) -> StepResult:
    """Put an item's wishes in force."""
    state = state._replace(mission=state.mission._replace(entered_us=state.time_us), path=None)
    setpoint = state.setpoint
    match item.command:
        case MavCmd.DO_CHANGE_ALTITUDE | MavCmd.CONDITION_CHANGE_ALT:
            setpoint = setpoint._replace(depth_m=_new_depth_m(item))
        case MavCmd.CONDITION_YAW:
            setpoint = setpoint._replace(heading_rad=_heading(item, state))
        case MavCmd.DO_CHANGE_SPEED:
            setpoint = setpoint._replace(thrust=_thrust(item, setpoint.thrust, config))
        case MavCmd.NAV_RETURN_TO_LAUNCH:
            return begin_rtl(state, config)
        case MavCmd.NAV_LAND if guidance.item_position(item, state.home) is None:
            return modes.enter(state, modes.SURFACE)
        case _ if item.command in _POSITION_COMMANDS:
            return _begin_leg(item, state, config), ()
        case MavCmd.USER_1:
            return start_test(excitation_of(item, state, config), state)
    return state._replace(setpoint=setpoint), ()


def begin_rtl(state: AutopilotState, config: Config) -> StepResult:
    """RTL where home is known, else up."""
    if not state.home.known:
        state, events = modes.enter(state, modes.SURFACE)
        return state, (Event(Severity.WARNING, "RTL refused: home is not known"), *events)
    state, events = modes.enter(state, modes.RTL)
    return guidance.hold_current(state, config), events


def _begin_leg(item: MissionItem, state: AutopilotState, config: Config) -> AutopilotState:
    """Set out to the place of an item: by the line from the last waypoint where she is near it, or
    from here."""
    here = guidance.current_position(state.estimate)
    place = guidance.item_position(item, state.home)
    to_m = here if place is None else place
    if item.command != MavCmd.NAV_LAND:  # its altitude is that of the end
        depth_m = guidance.item_depth_m(item, state.setpoint.depth_m)
        state = state._replace(setpoint=state.setpoint._replace(depth_m=depth_m))
    if item.command in (MavCmd.NAV_WAYPOINT, MavCmd.NAV_LAND):
        left_m = state.mission.left_m
        near = left_m is not None and abs(here - left_m) <= config.lookahead_m
        return state._replace(path=TrackLine(left_m if left_m is not None and near else here, to_m))
    return state._replace(path=guidance.circle(to_m, item.p3, config))


def _start_waypoint_orbit(
    item: MissionItem, state: AutopilotState, config: Config
) -> AutopilotState:
    """A waypoint that is to be held is circled once it is reached: she cannot hover."""
    path = state.path
    if item.command != MavCmd.NAV_WAYPOINT or not item.p1 > 0.0 or not isinstance(path, TrackLine):
        return state
    if not guidance.reached(path, state.estimate, _acceptance_m(item, config)):
        return state
    return state._replace(path=guidance.circle(path.to_m, 0.0, config, since_us=state.time_us))


def _acceptance_m(item: MissionItem, config: Config) -> float:
    given = item.p2 if item.command == MavCmd.NAV_WAYPOINT else 0.0
    return given if given > 0.0 else config.acceptance_m


def item_done(item: MissionItem, state: AutopilotState, config: Config) -> bool:
    """Whether an item that was begun has come to its end."""
    path, entered_us = state.path, state.mission.entered_us
    match item.command:
        case MavCmd.NAV_DELAY:
            return (
                state.time_us - (state.time_us if entered_us is None else entered_us)
            ) / US_PER_S >= item.p1
        case MavCmd.CONDITION_CHANGE_ALT:
            return abs(state.estimate.depth_m - _new_depth_m(item)) < DEPTH_REACHED_M
        case MavCmd.USER_1:
            return state.test is None
        case MavCmd.NAV_LOITER_UNLIM:
            return False
    if isinstance(path, TrackLine):
        return guidance.reached(path, state.estimate, _acceptance_m(item, config))
    if isinstance(path, Circle):
        turns = item.command == MavCmd.NAV_LOITER_TURNS
        return (
            path.turned_rad >= 2.0 * math.pi * item.p1 if turns else _orbit_done(path, item, state)
        )
    return True


def _orbit_done(path: Circle, item: MissionItem, state: AutopilotState) -> bool:
    return path.since_us is not None and guidance.orbit_time_s(path, state.time_us) >= item.p1


def excitation_of(item: MissionItem, state: AutopilotState, config: Config) -> Excitation:
    """The excitation that a MAV_CMD_USER_1 item describes (x: whole seconds, y: wave, z: fade)."""
    fade_s = 0.0 if math.isnan(item.z) else item.z
    wish = excitation.from_numbers(
        int(item.p1), item.p2, item.p3, item.p4, float(item.x), item.y, fade_s
    )
    return excitation.precompute(wish, state, config)


def start_test(test: Excitation, state: AutopilotState) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Begin an excitation."""
    return state._replace(test=test), (
        Event(Severity.INFO, f"SystemID Starting: {excitation.describe(test)}"),
    )


def _items_to_fly(items: tuple[MissionItem, ...], config: Config) -> tuple[MissionItem, ...]:
    return items[1:] if config.mission_seq0_home else items


def _advance_item(item: MissionItem, state: AutopilotState) -> AutopilotState:
    mission = state.mission
    index, jumps = mission.current + 1, mission.jumps
    if item.command == MavCmd.DO_JUMP:
        at = bisect_left(jumps, (item.sequence,))
        count = jumps[at][1] if at < len(jumps) and jumps[at][0] == item.sequence else 0
        if item.p2 < 0 or count < item.p2:
            index = int(item.p1)
            jumps = (*jumps[:at], (item.sequence, count + 1), *jumps[at + (count > 0) :])
    return state._replace(
        mission=mission._replace(
            current=index,
            entered_us=None,
            jumps=jumps,
            reached=item.sequence,
            left_m=_last_waypoint_m(item, state),
        )
    )


def _last_waypoint_m(item: MissionItem, state: AutopilotState) -> complex | None:
    """The last waypoint that was reached."""
    if item.command == MavCmd.NAV_WAYPOINT and isinstance(state.path, TrackLine):
        return state.path.to_m
    return state.mission.left_m


def _complete(state: AutopilotState, config: Config) -> tuple[AutopilotState, tuple[Event, ...]]:
    said = Event(Severity.INFO, "Mission complete")
    if config.mission_end == 2:
        return modes.disarm(state), (said, Event(Severity.INFO, "Disarmed"))
    state, events = modes.enter(state, modes.SURFACE if config.mission_end == 1 else modes.HOLD)
    return state, (said, *events)


def _new_depth_m(item: MissionItem) -> float:
    """What a change of altitude asks for."""
    return (
        -item.p1 if item.command == MavCmd.DO_CHANGE_ALTITUDE else guidance.item_depth_m(item, 0.0)
    )


def _heading(item: MissionItem, state: AutopilotState) -> float:
    """A turn without a direction is clockwise."""
    angle = math.radians(item.p1)
    if item.p4 == 1:
        return wrap_pi(state.setpoint.heading_rad + (-angle if item.p3 < 0 else angle))
    return wrap_pi(angle)


def _thrust(item: MissionItem, thrust: float, config: Config) -> float:
    """A percentage where one is given, else from the speed."""
    if item.p3 >= 0:
        return min(1.0, item.p3 / 100.0)
    if item.p2 >= 0:
        return offboard.thrust_for(item.p2, config)
    return config.cruise_thrust_pct / 100.0 if item.p2 == -2 else thrust
