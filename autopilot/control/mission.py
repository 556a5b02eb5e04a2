"""Flies the uploaded items: each begins once, then is asked every tick whether it is done."""

import math
from enum import IntEnum
from typing import NamedTuple

from autopilot.control import excitation, guidance, modes, offboard
from autopilot.control.params import Config
from autopilot.control.setpoints import Circle, Line
from autopilot.control.types import (
    US_PER_S,
    Event,
    Excitation,
    Home,
    ItemReached,
    MissionState,
    Severity,
    State,
)
from mavlink_io.frames import wrap_pi
from mavlink_io.services.missions import (
    FRAME_LOCAL_NED,
    GLOBAL_FRAMES,
    MissionItem,
    place_fault,
)


class Command(IntEnum):
    """MAV_CMD of the items that this vehicle flies."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN = 20
    LAND = 21
    DELAY = 93
    CHANGE_ALTITUDE_WAIT = 113
    YAW = 115
    JUMP = 177
    CHANGE_SPEED = 178
    CHANGE_ALTITUDE = 186
    TEST = 31010
    """MAV_CMD_USER_1."""


COMMANDS = frozenset(Command)

DEPTH_REACHED_M = 0.3
DEPTH_ROUNDING_M = 1e-3
"""Rounding of a depth in a float32: half of 0.5 mm at the 6000 m that FS_DEPTH_M may be at most."""

_PLACED = frozenset(
    (
        Command.WAYPOINT,
        Command.LOITER_UNLIMITED,
        Command.LOITER_TURNS,
        Command.LOITER_TIME,
        Command.LAND,
    )
)
"""Items that may give a place."""
_DEEP = _PLACED | {Command.CHANGE_ALTITUDE_WAIT}
"""Items whose z is a depth or an altitude."""

Outcome = tuple[State, tuple[Event | ItemReached, ...]]


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
    for item in _flown(items, config):
        parameter, reason = _fault(item, len(items), config)
        if not reason:
            parameter, reason = _out_of_reach(item, home, config)
        if reason:
            return Fault(item.sequence, reason, parameter)
    return None


_NEEDS: dict[int, tuple[str, ...]] = {
    Command.DELAY: ("p1",),
    Command.LOITER_TIME: ("p1",),
    Command.LOITER_TURNS: ("p1",),
    Command.YAW: ("p1",),
    Command.JUMP: ("p1", "p2"),
    Command.CHANGE_ALTITUDE: ("p1",),
    Command.CHANGE_ALTITUDE_WAIT: ("z",),
    Command.TEST: ("p1", "p2"),
}
"""The numbers without which an item means nothing; NaN in any other field means "not given"."""


def _fault(item: MissionItem, count: int, config: Config) -> Wrong:
    """What is wrong with an item wherever the vehicle is."""
    if item.command not in COMMANDS:
        return 0, f"command {item.command} is not one this vehicle flies"
    for name in _NEEDS.get(item.command, ()):
        if not math.isfinite(getattr(item, name)):
            return _FIELDS[name], f"{name} of command {item.command}: must be a number"
    for name, parameter in _FIELDS.items():
        if math.isinf(getattr(item, name)):
            return parameter, f"{name} of command {item.command}: must be finite"
    if item.command == Command.JUMP and not 0 <= item.p1 < count:
        return 1, f"DO_JUMP to {item.p1:g}: there is no such item"
    if item.command == Command.CHANGE_ALTITUDE and item.p1 > 0.0:
        return 1, f"altitude {item.p1:g} m: must be 0 or negative, depth is minus altitude"
    if item.command in _DEEP and guidance.depth_of(item, 0.0) < 0.0:
        depth_m = guidance.depth_of(item, 0.0)
        return 7, f"depth {depth_m:g} m: must be 0 or more; z is down in a local frame, else up"
    if item.command in _DEEP or item.command == Command.CHANGE_ALTITUDE:
        depth_m, limit_m = _new_depth_m(item), config.fs_depth_m
        if depth_m > limit_m + DEPTH_ROUNDING_M:
            parameter = 7 if item.command in _DEEP else 1
            return parameter, f"depth {depth_m:g} m: must be at most FS_DEPTH_M = {limit_m:g} m"
    if item.command in _PLACED:
        return place_fault(item)
    if item.command == Command.TEST:
        return 0, excitation.check(test_of(item, State(), config), config.travel_deg)
    return 0, ""


def _out_of_reach(item: MissionItem, home: Home, config: Config) -> Wrong:
    """Whether the place of an item is too far from home, as far as home is known."""
    limit_m = config.mission_distance_m
    if (
        limit_m == 0.0
        or item.command not in _PLACED
        or not (home.known or item.frame == FRAME_LOCAL_NED)
    ):
        return 0, ""
    place_m = guidance.place_of(item, home)
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
        item.command == Command.RETURN
        or (
            item.command in _PLACED
            and item.frame in GLOBAL_FRAMES
            and guidance.place_of(item, Home()) is not None
        )
        for item in _flown(items, config)
    )


def restart(mission: MissionState, config: Config) -> MissionState:
    """The same items from their first."""
    first = len(mission.items) - len(_flown(mission.items, config))
    return MissionState(mission.items, first)


def advance(state: State, config: Config) -> Outcome:
    """Begin and finish as many items as this tick allows."""
    events: list[Event | ItemReached] = []
    for _ in range(len(state.mission.items) + 1):
        mission = state.mission
        if mission.current >= len(mission.items):
            state, ended = _end(state, config)
            return state, (*events, *ended)
        item = mission.items[mission.current]
        if mission.entered_us is None:
            state, begun = begin(item, state, config)
            events += begun
        state = _turn_up(item, state, config)
        if state.mode != modes.MISSION.number or not done(item, state, config):
            break
        if item.command == Command.LAND:
            state, surfacing = modes.enter(state, modes.SURFACE)
            return state, (*events, *surfacing)
        state = _next(item, state)
        events.append(ItemReached(item.sequence))
    return state, tuple(events)


def begin(item: MissionItem, state: State, config: Config) -> Outcome:
    """Put an item's wishes in force."""
    state = state._replace(mission=state.mission._replace(entered_us=state.time_us), path=None)
    setpoint = state.setpoint
    match item.command:
        case Command.CHANGE_ALTITUDE | Command.CHANGE_ALTITUDE_WAIT:
            setpoint = setpoint._replace(depth_m=_new_depth_m(item))
        case Command.YAW:
            setpoint = setpoint._replace(heading_rad=_heading(item, state))
        case Command.CHANGE_SPEED:
            setpoint = setpoint._replace(thrust=_thrust(item, setpoint.thrust, config))
        case Command.RETURN:
            return go_home(state, config)
        case Command.LAND if guidance.place_of(item, state.home) is None:
            return modes.enter(state, modes.SURFACE)
        case _ if item.command in _PLACED:
            return _go(item, state, config), ()
        case Command.TEST:
            return start_test(test_of(item, state, config), state)
    return state._replace(setpoint=setpoint), ()


def go_home(state: State, config: Config) -> Outcome:
    """RTL where home is known, else up."""
    if not state.home.known:
        state, events = modes.enter(state, modes.SURFACE)
        return state, (Event(Severity.WARNING, "RTL refused: home is not known"), *events)
    state, events = modes.enter(state, modes.RTL)
    return guidance.take_up(state, config), events


def _go(item: MissionItem, state: State, config: Config) -> State:
    """Set out to the place of an item: by the line from the last waypoint where she is near it, or
    from here."""
    here = guidance.here(state.estimate)
    place = guidance.place_of(item, state.home)
    to_m = here if place is None else place
    if item.command != Command.LAND:  # its altitude is that of the end
        depth_m = guidance.depth_of(item, state.setpoint.depth_m)
        state = state._replace(setpoint=state.setpoint._replace(depth_m=depth_m))
    if item.command in (Command.WAYPOINT, Command.LAND):
        left_m = state.mission.left_m
        near = left_m is not None and abs(here - left_m) <= config.lookahead_m
        return state._replace(path=Line(left_m if left_m is not None and near else here, to_m))
    return state._replace(path=guidance.circle(to_m, item.p3, config))


def _turn_up(item: MissionItem, state: State, config: Config) -> State:
    """A waypoint that is to be held is circled once it is reached: she cannot hover."""
    path = state.path
    if item.command != Command.WAYPOINT or not item.p1 > 0.0 or not isinstance(path, Line):
        return state
    if not guidance.reached(path, state.estimate, _acceptance_m(item, config)):
        return state
    return state._replace(path=guidance.circle(path.to_m, 0.0, config, since_us=state.time_us))


def _acceptance_m(item: MissionItem, config: Config) -> float:
    given = item.p2 if item.command == Command.WAYPOINT else 0.0
    return given if given > 0.0 else config.acceptance_m


def done(item: MissionItem, state: State, config: Config) -> bool:
    """Whether an item that was begun has come to its end."""
    path, entered_us = state.path, state.mission.entered_us
    match item.command:
        case Command.DELAY:
            return (
                state.time_us - (state.time_us if entered_us is None else entered_us)
            ) / US_PER_S >= item.p1
        case Command.CHANGE_ALTITUDE_WAIT:
            return abs(state.estimate.depth_m - _new_depth_m(item)) < DEPTH_REACHED_M
        case Command.TEST:
            return state.test is None
        case Command.LOITER_UNLIMITED:
            return False
    if isinstance(path, Line):
        return guidance.reached(path, state.estimate, _acceptance_m(item, config))
    if isinstance(path, Circle):
        turns = item.command == Command.LOITER_TURNS
        return path.turned_rad >= 2.0 * math.pi * item.p1 if turns else _circled(path, item, state)
    return True


def _circled(path: Circle, item: MissionItem, state: State) -> bool:
    return path.since_us is not None and guidance.circled_s(path, state.time_us) >= item.p1


def test_of(item: MissionItem, state: State, config: Config) -> Excitation:
    """The excitation that a MAV_CMD_USER_1 item describes (x: whole seconds, y: wave, z: fade)."""
    fade_s = 0.0 if math.isnan(item.z) else item.z
    wish = excitation.read(int(item.p1), item.p2, item.p3, item.p4, float(item.x), item.y, fade_s)
    return excitation.prepare(wish, state, config)


def start_test(test: Excitation, state: State) -> tuple[State, tuple[Event, ...]]:
    """Begin an excitation."""
    return state._replace(test=test), (
        Event(Severity.INFO, f"SystemID Starting: {excitation.describe(test)}"),
    )


def _flown(items: tuple[MissionItem, ...], config: Config) -> tuple[MissionItem, ...]:
    return items[1:] if config.mission_seq0_home else items


def _next(item: MissionItem, state: State) -> State:
    mission = state.mission
    index, jumps = mission.current + 1, mission.jumps
    if item.command == Command.JUMP:
        taken = dict(jumps)
        count = taken.get(item.sequence, 0)
        if item.p2 < 0 or count < item.p2:
            index = int(item.p1)
            jumps = tuple(sorted({**taken, item.sequence: count + 1}.items()))
    return state._replace(
        mission=mission._replace(
            current=index,
            entered_us=None,
            jumps=jumps,
            reached=item.sequence,
            left_m=_left_m(item, state),
        )
    )


def _left_m(item: MissionItem, state: State) -> complex | None:
    """The last waypoint that was reached."""
    if item.command == Command.WAYPOINT and isinstance(state.path, Line):
        return state.path.to_m
    return state.mission.left_m


def _end(state: State, config: Config) -> tuple[State, tuple[Event, ...]]:
    said = Event(Severity.INFO, "Mission complete")
    if config.mission_end == 2:
        return modes.disarm(state), (said, Event(Severity.INFO, "Disarmed"))
    state, events = modes.enter(state, modes.SURFACE if config.mission_end == 1 else modes.HOLD)
    return state, (said, *events)


def _new_depth_m(item: MissionItem) -> float:
    """What a change of altitude asks for."""
    return -item.p1 if item.command == Command.CHANGE_ALTITUDE else guidance.depth_of(item, 0.0)


def _heading(item: MissionItem, state: State) -> float:
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
