"""Flies the uploaded items: each begins once, then is asked every tick whether it is done."""

import math
from enum import IntEnum

from autopilot import excitation, guidance, modes
from autopilot.params import Config
from autopilot.types import US_PER_S, Event, Excitation, ItemReached, MissionState, Severity, State
from link.frames import wrap_pi
from link.missions import MissionItem


class Command(IntEnum):
    """MAV_CMD of the items that this vehicle flies."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
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

Outcome = tuple[State, tuple[Event | ItemReached, ...]]


def check(items: tuple[MissionItem, ...], config: Config) -> tuple[int, str]:
    """The first item that this vehicle cannot fly and why; (-1, "") when it can fly them all."""
    for item in _flown(items, config):
        if wrong := _fault(item, len(items), config):
            return item.sequence, wrong
    return -1, ""


_NEEDS: dict[int, tuple[str, ...]] = {
    Command.DELAY: ("p1",),
    Command.LOITER_TIME: ("p1",),
    Command.YAW: ("p1",),
    Command.JUMP: ("p1", "p2"),
    Command.CHANGE_ALTITUDE: ("p1",),
    Command.CHANGE_ALTITUDE_WAIT: ("z",),
    Command.TEST: ("p1", "p2"),
}
"""The numbers without which an item means nothing; NaN in any other field means "not given"."""


def _fault(item: MissionItem, count: int, config: Config) -> str:
    """What is wrong with an item; empty when it can be flown."""
    if item.command not in COMMANDS:
        return f"command {item.command} is not one this vehicle flies"
    for name in _NEEDS.get(item.command, ()):
        if not math.isfinite(getattr(item, name)):
            return f"{name} of command {item.command}: must be a number"
    if any(math.isinf(value) for value in (item.p1, item.p2, item.p3, item.p4, item.z)):
        return f"command {item.command}: infinite"
    if item.command == Command.JUMP and not 0 <= item.p1 < count:
        return f"DO_JUMP to {item.p1:g}: there is no such item"
    if item.command == Command.CHANGE_ALTITUDE and item.p1 > 0.0:
        return f"altitude {item.p1:g} m: must be 0 or negative, depth is minus altitude"
    if item.command == Command.TEST:
        return excitation.check(test_of(item, State()), config.travel_deg)
    return ""


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
        if state.mode != modes.MISSION.number or not done(item, state):
            break
        state = _next(item, state)
        events.append(ItemReached(item.sequence))
    return state, tuple(events)


def begin(item: MissionItem, state: State, config: Config) -> Outcome:
    """Put an item's wishes in force."""
    state = state._replace(mission=state.mission._replace(entered_us=state.time_us))
    setpoint = state.setpoint
    match item.command:
        case Command.CHANGE_ALTITUDE | Command.CHANGE_ALTITUDE_WAIT:
            depth = -item.p1 if item.command == Command.CHANGE_ALTITUDE else -item.z
            setpoint = setpoint._replace(depth_m=depth)
        case Command.YAW:
            setpoint = setpoint._replace(heading_rad=_heading(item, state))
        case Command.CHANGE_SPEED:
            setpoint = setpoint._replace(thrust=_thrust(item, setpoint.thrust, config))
        case Command.WAYPOINT:
            setpoint = setpoint._replace(depth_m=guidance.target(item, state.home, state.estimate)[2])
        case Command.RETURN | Command.LAND:
            return modes.enter(state, modes.SURFACE)
        case Command.TEST:
            return start_test(test_of(item, state), state)
    return state._replace(setpoint=setpoint), ()


def done(item: MissionItem, state: State) -> bool:
    """Whether an item that was begun has come to its end."""
    entered_us = state.mission.entered_us
    elapsed_s = (state.time_us - (state.time_us if entered_us is None else entered_us)) / US_PER_S
    match item.command:
        case Command.DELAY | Command.LOITER_TIME:
            return elapsed_s >= item.p1
        case Command.CHANGE_ALTITUDE_WAIT:
            return abs(state.estimate.depth_m + item.z) < DEPTH_REACHED_M
        case Command.WAYPOINT:
            north, east, _ = guidance.target(item, state.home, state.estimate)
            return guidance.distance_m(north, east, state.estimate) < (item.p2 or guidance.DEFAULT_ACCEPTANCE_M)
        case Command.TEST:
            return state.test is None
        case Command.LOITER_UNLIMITED:
            return False
    return True


def steer(state: State) -> State:
    """Point at the waypoint being flown; other items leave the heading as it is."""
    mission = state.mission
    if mission.current >= len(mission.items) or mission.items[mission.current].command != Command.WAYPOINT:
        return state
    north, east, _ = guidance.target(mission.items[mission.current], state.home, state.estimate)
    heading = guidance.bearing_rad(north, east, state.estimate)
    return state._replace(setpoint=state.setpoint._replace(heading_rad=heading))


def test_of(item: MissionItem, state: State) -> Excitation:
    """The excitation that a MAV_CMD_USER_1 item describes (x: whole seconds, y: wave, z: fade)."""
    fade_s = 0.0 if math.isnan(item.z) else item.z
    return Excitation(
        int(item.p1), math.radians(item.p2), item.p3, item.p4, float(item.x), item.y, fade_s, state.time_us,
        state.setpoint.heading_rad, state.setpoint.depth_m,
    )  # fmt: skip


def start_test(test: Excitation, state: State) -> tuple[State, tuple[Event, ...]]:
    """Begin an excitation."""
    size = math.degrees(test.magnitude_rad)
    text = f"SystemID Starting: axis={test.axis} wave={excitation.WAVES[test.wave]} magnitude={size:.2f}"
    return state._replace(test=test), (Event(Severity.INFO, text),)


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
    return state._replace(mission=mission._replace(current=index, entered_us=None, jumps=jumps, reached=item.sequence))


def _end(state: State, config: Config) -> tuple[State, tuple[Event, ...]]:
    said = Event(Severity.INFO, "Mission complete")
    if config.mission_end == 2:
        return modes.disarm(state), (said, Event(Severity.INFO, "Disarmed"))
    state, events = modes.enter(state, modes.SURFACE if config.mission_end == 1 else modes.HOLD)
    return state, (said, *events)


def _heading(item: MissionItem, state: State) -> float:
    angle = math.radians(item.p1)
    if item.p4 == 1:
        return wrap_pi(state.setpoint.heading_rad + (angle if item.p3 >= 0 else -angle))
    return wrap_pi(angle)


def _thrust(item: MissionItem, thrust: float, config: Config) -> float:
    """A percentage where one is given, else from the speed: a propeller's speed grows with its revolutions."""
    if item.p3 >= 0:
        return min(1.0, item.p3 / 100.0)
    if item.p2 >= 0:
        return min(1.0, item.p2 / config.cruise_speed_mps * config.cruise_thrust_pct / 100.0)
    return config.cruise_thrust_pct / 100.0 if item.p2 == -2 else thrust
