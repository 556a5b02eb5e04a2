"""Execution of missions: start each item once, then check in every tick whether it is done. Pure.

Positions are complex numbers, north + i east from home (m); depth is positive down.
"""

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
    Events,
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
    LENGTH_ROUNDING_M,
    SPEED_ROUNDING_MPS,
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
"""Maximum depth error at which CHANGE_ALTITUDE_WAIT is done."""
ITEMS_PER_TICK = 10
"""Maximum number of items, jumps included, completed in one tick; the next tick continues. Without
it an endless loop of jumps would block the tick."""

POSITION_COMMANDS = frozenset(
    (
        MavCmd.NAV_WAYPOINT,
        MavCmd.NAV_LOITER_UNLIM,
        MavCmd.NAV_LOITER_TURNS,
        MavCmd.NAV_LOITER_TIME,
        MavCmd.NAV_LAND,
    )
)
"""Commands with a position."""
CIRCLE_COMMANDS = frozenset(
    (MavCmd.NAV_LOITER_UNLIM, MavCmd.NAV_LOITER_TURNS, MavCmd.NAV_LOITER_TIME)
)
"""Commands that circle their position with the radius of p3."""
_END_COMMANDS = frozenset((MavCmd.NAV_LAND, MavCmd.NAV_RETURN_TO_LAUNCH))
"""Commands that leave mode MISSION: the vehicle surfaces and disarms."""
_DEPTH_COMMANDS = POSITION_COMMANDS | {MavCmd.CONDITION_CHANGE_ALT}
"""Commands whose z is a depth or an altitude."""

StepResult = tuple[AutopilotState, Events]


_FIELDS = {"p1": 1, "p2": 2, "p3": 3, "p4": 4, "z": 7}
"""Real-valued parameters of an item, with their numbers in MAV_MISSION_RESULT."""

ItemFault = tuple[int, str]
"""Number of the wrong parameter (0: none in particular) and the reason, empty if valid."""


class MissionFault(NamedTuple):
    """First reason why a mission cannot be flown."""

    sequence: int
    """Sequence of the item."""
    reason: str
    """Reason with the value and the limit."""
    parameter: int = 0
    """Number of the wrong parameter, 1 to 7; 0 for none in particular."""


def check(items: tuple[MissionItem, ...], config: Config) -> tuple[int, str]:
    """Check a mission without regard to home.

    Parameters
    ----------
    items : tuple[MissionItem, ...]
        Mission items.
    config : Config
        Parameters with the limits.

    Returns
    -------
    tuple[int, str]
        Sequence of the first item that cannot be flown and the reason; (-1, "") if all can.
    """
    fault = find_fault(items, Home(), config)
    return (-1, "") if fault is None else fault[:2]


def find_fault(items: tuple[MissionItem, ...], home: Home, config: Config) -> MissionFault | None:
    """Return the first fault of a mission, None if all items can be flown.

    A mission is checked when it is loaded and again when it is started: home and limits may have
    changed in between.
    """
    for item in items_to_fly(items, config):
        parameter, reason = _item_fault(item, config)
        if not reason and item.command == MavCmd.DO_JUMP:
            parameter, reason = _jump_fault(item, len(items), config)
        if not reason:
            parameter, reason = _distance_fault(item, home, config)
        if reason:
            return MissionFault(item.sequence, reason, parameter)
    return None


def wanted_depth_m(item: MissionItem) -> float | None:
    """Return the depth that an item sets; None if it sets none."""
    if item.command == MavCmd.NAV_LAND:
        return None
    if item.command == MavCmd.DO_CHANGE_ALTITUDE or (
        item.command in _DEPTH_COMMANDS and not math.isnan(item.z)
    ):
        return new_depth_m(item)
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
"""Parameters that must be numbers; NaN in any other parameter means "not given"."""


class _Range(NamedTuple):
    """Valid values of a parameter of a command."""

    field: str
    meaning: str
    least: float = -math.inf
    most: float = math.inf
    special: tuple[float, ...] = ()
    """Further valid values."""

    def fault(self, item: MissionItem) -> ItemFault:
        """Return the fault of an item; NaN is "not given"."""
        value = getattr(item, self.field)
        if math.isnan(value) or self.least <= value <= self.most or value in self.special:
            return 0, ""
        choices = [f"{choice:g}" for choice in self.special]
        if self.least <= self.most:
            limits = f"at least {self.least:g}"
            if math.isfinite(self.most):
                limits = f"{self.least:g} to {self.most:g}"
            choices.insert(0, limits)
        valid = " or ".join(filter(None, (", ".join(choices[:-1]), choices[-1])))
        return _FIELDS[self.field], f"{self.meaning} {value:g}: must be {valid}"


def _choice(field: str, meaning: str, *values: float) -> _Range:
    """Return the range of a parameter with a few valid values."""
    return _Range(field, meaning, math.inf, -math.inf, values)


_CHANGE_NOTHING, _DEFAULT = -1.0, -2.0
"""Special values of DO_CHANGE_SPEED."""
_RANGES: dict[int, tuple[_Range, ...]] = {
    MavCmd.NAV_WAYPOINT: (
        _Range("p1", "hold time (s)", 0.0),
        _Range("p2", "acceptance radius (m)", 0.0),
    ),
    MavCmd.NAV_LOITER_TIME: (_Range("p1", "time (s)", 0.0),),
    MavCmd.NAV_LOITER_TURNS: (_Range("p1", "number of turns", 0.0),),
    # -1 would be a clock time in p2 to p4
    MavCmd.NAV_DELAY: (_Range("p1", "time (s)", 0.0),),
    MavCmd.CONDITION_YAW: (
        _Range("p1", "heading (deg)", -360.0, 360.0),
        _choice("p3", "direction", -1.0, 0.0, 1.0),
        _choice("p4", "relative", 0.0, 1.0),
    ),
    MavCmd.DO_CHANGE_SPEED: (
        _choice("p1", "kind of speed", 0.0, 1.0),
        _Range("p2", "speed (m/s)", 0.0, special=(_CHANGE_NOTHING, _DEFAULT)),
        _Range("p3", "thrust (%)", 0.0, 100.0, (_CHANGE_NOTHING, _DEFAULT)),
    ),
    MavCmd.DO_CHANGE_ALTITUDE: (_choice("p2", "frame", *sorted(GLOBAL_FRAMES)),),
    MavCmd.DO_JUMP: (_Range("p2", "number of jumps", 0.0, special=(-1.0,)),),
}
"""Valid values of parameters, where a command has limits."""


def _range_fault(item: MissionItem, config: Config) -> ItemFault:
    """Return the first parameter of an item that is out of its range."""
    for valid in _RANGES.get(item.command, ()):
        parameter, reason = valid.fault(item)
        if reason:
            return parameter, reason
    least_m = config.turn_radius_m
    if item.command in CIRCLE_COMMANDS and 0.0 < abs(item.p3) < least_m - LENGTH_ROUNDING_M:
        limit = f"0 or at least {least_m:g} m, the turning circle (TURN_RADIUS_M)"
        return 3, f"radius {item.p3:g} m: must be {limit}"
    full_thrust_mps = offboard.full_thrust_speed_mps(config)
    if item.command == MavCmd.DO_CHANGE_SPEED and item.p2 > full_thrust_mps + SPEED_ROUNDING_MPS:
        limit = f"{full_thrust_mps:.2f} m/s, that of full thrust (SPD_CRUISE_MPS, THR_CRUISE_PCT)"
        return 2, f"speed {item.p2:g} m/s: must be at most {limit}"
    return 0, ""


def _jump_fault(item: MissionItem, count: int, config: Config) -> ItemFault:
    """Return the fault of a jump in a mission of ``count`` items."""
    first = 1 if config.mission_seq0_home else 0
    if not first <= item.p1 < count:
        return 1, f"DO_JUMP to {item.p1:g}: there is no such item"
    if item.p1 != int(item.p1):
        return 1, f"DO_JUMP to {item.p1:g}: must be the number of an item"
    if item.p2 < 0.0 and not config.fs_battery_action:
        return 2, "endless DO_JUMP: must have a battery failsafe that ends it (FS_BATT_ACT)"
    return 0, ""


def _item_fault(item: MissionItem, config: Config) -> ItemFault:
    """Return the fault of an item that does not depend on home."""
    if item.command not in COMMANDS:
        return 0, f"command {item.command} is not one this vehicle flies"
    for name in _REQUIRED_PARAMETERS.get(item.command, ()):
        if not math.isfinite(getattr(item, name)):
            return _FIELDS[name], f"{name} of command {item.command}: must be a number"
    for name, parameter in _FIELDS.items():
        if math.isinf(getattr(item, name)):
            return parameter, f"{name} of command {item.command}: must be finite"
    parameter, reason = _range_fault(item, config)
    if reason:
        return parameter, reason
    if item.command == MavCmd.DO_CHANGE_ALTITUDE and item.p1 > 0.0:
        return 1, f"altitude {item.p1:g} m: must be 0 or negative, depth is minus altitude"
    if item.command in _DEPTH_COMMANDS and guidance.item_depth_m(item, 0.0) < 0.0:
        depth_m = guidance.item_depth_m(item, 0.0)
        return 7, f"depth {depth_m:g} m: must be 0 or more; z is down in a local frame, else up"
    if item.command in _DEPTH_COMMANDS or item.command == MavCmd.DO_CHANGE_ALTITUDE:
        depth_m, limit_m = new_depth_m(item), config.fs_depth_m
        if depth_m > limit_m + LENGTH_ROUNDING_M:
            parameter = 7 if item.command in _DEPTH_COMMANDS else 1
            return parameter, f"depth {depth_m:g} m: must be at most FS_DEPTH_M = {limit_m:g} m"
    if item.command in POSITION_COMMANDS:
        return place_fault(item)
    if item.command == MavCmd.USER_1:
        return 0, excitation.check(excitation_of(item, AutopilotState(), config), config.travel_deg)
    return 0, ""


def _distance_fault(item: MissionItem, home: Home, config: Config) -> ItemFault:
    """Return the fault of an item farther from home than MIS_DIST_MAX; none if home is unknown."""
    limit_m = config.mission_distance_m
    if (
        limit_m == 0.0
        or item.command not in POSITION_COMMANDS
        or not (home.known or item.frame == FRAME_LOCAL_NED)
    ):
        return 0, ""
    position_m = guidance.item_position(item, home)
    radius_m = circle_radius_m(item, config)
    if item.p3 and radius_m > limit_m - abs(position_m or 0.0) > 0.0:
        reach = f"circle of {radius_m:g} m, {abs(position_m or 0.0):.0f} m from home"
        return 3, f"{reach}: must stay within MIS_DIST_MAX = {limit_m:g} m"
    if position_m is None or abs(position_m) <= limit_m:
        return 0, ""
    parameter = 5 if abs(position_m.real) >= abs(position_m.imag) else 6
    return (
        parameter,
        f"{abs(position_m):.0f} m from home: must be at most MIS_DIST_MAX = {limit_m:g} m",
    )


def circle_radius_m(item: MissionItem, config: Config) -> float:
    """Return the radius of the circle that an item flies (m); 0 if it flies none."""
    if item.command == MavCmd.NAV_WAYPOINT:
        return config.station_radius_m if item.p1 > 0.0 else 0.0
    if item.command in CIRCLE_COMMANDS:
        return guidance.circle(0j, item.p3, config).radius_m
    return 0.0


def needs_home(items: tuple[MissionItem, ...], config: Config) -> bool:
    """Return whether a mission has items with latitude and longitude, or RTL."""
    return any(
        item.command == MavCmd.NAV_RETURN_TO_LAUNCH
        or (
            item.command in POSITION_COMMANDS
            and item.frame in GLOBAL_FRAMES
            and guidance.item_position(item, Home()) is not None
        )
        for item in items_to_fly(items, config)
    )


def restart(mission: MissionState, config: Config) -> MissionState:
    """Return the mission reset to its first item to fly."""
    first = len(mission.items) - len(items_to_fly(mission.items, config))
    return MissionState(mission.items, first)


def step(state: AutopilotState, config: Config) -> StepResult:
    """Start and complete items, at most ITEMS_PER_TICK.

    Returns the new state and the events, ItemReached included.
    """
    events: list[Event | ItemReached] = []
    for _ in range(ITEMS_PER_TICK):
        mission = state.mission
        if mission.current >= len(mission.items):
            state, end_events = _complete(state, config)
            return state, (*events, *end_events)
        item = mission.items[mission.current]
        if mission.entered_us is None:
            state, start_events = begin_item(item, state, config)
            events += start_events
        state = _start_waypoint_orbit(item, state, config)
        is_done = state.mode == modes.MISSION.number and item_done(item, state, config)
        if is_done and item.command == MavCmd.NAV_LAND:
            state, mode_events = modes.enter(state, modes.SURFACE)
            events += mode_events
        if state.mode != modes.MISSION.number:
            left = state.mission._replace(reached=item.sequence)
            return state._replace(mission=left), tuple(events)
        if not is_done:
            break
        state = _advance_item(item, state)
        events.append(ItemReached(item.sequence))
    return state, tuple(events)


def is_ending(state: AutopilotState) -> bool:
    """Return whether an item of the mission has commanded the present SURFACE or RTL."""
    mission = state.mission
    if mission.current >= len(mission.items):
        return False
    item = mission.items[mission.current]
    return (
        item.command in _END_COMMANDS
        and mission.reached == item.sequence
        and state.mode in (modes.SURFACE.number, modes.RTL.number)
    )


def end_at_surface(state: AutopilotState) -> StepResult:
    """Complete a mission that has commanded the present SURFACE or RTL.

    Its next start is at its first item. Until the vehicle has surfaced its current item stays, so
    that MISSION after HOLD continues the ascent.
    """
    if not is_ending(state):
        return state, ()
    mission = state.mission._replace(current=len(state.mission.items), entered_us=None)
    return state._replace(mission=mission), (ItemReached(mission.reached),)


def begin_item(item: MissionItem, state: AutopilotState, config: Config) -> StepResult:
    """Start an item: apply its set-points, path, mode or test."""
    state = state._replace(mission=state.mission._replace(entered_us=state.time_us), path=None)
    setpoint = state.setpoint
    match item.command:
        case MavCmd.DO_CHANGE_ALTITUDE | MavCmd.CONDITION_CHANGE_ALT:
            setpoint = setpoint._replace(depth_m=new_depth_m(item))
        case MavCmd.CONDITION_YAW:
            setpoint = setpoint._replace(heading_rad=_heading(item, state))
        case MavCmd.DO_CHANGE_SPEED:
            setpoint = setpoint._replace(thrust=item_thrust(item, setpoint.thrust, config))
        case MavCmd.NAV_RETURN_TO_LAUNCH:
            return begin_rtl(state, config)
        case MavCmd.NAV_LAND if guidance.item_position(item, state.home) is None:
            return modes.enter(state, modes.SURFACE)
        case _ if item.command in POSITION_COMMANDS:
            return _begin_leg(item, state, config), ()
        case MavCmd.USER_1:
            return start_test(excitation_of(item, state, config), state)
    return state._replace(setpoint=setpoint), ()


def begin_rtl(state: AutopilotState, config: Config) -> StepResult:
    """Change to RTL; to SURFACE if home is unknown."""
    if not state.home.known:
        state, events = modes.enter(state, modes.SURFACE)
        return state, (Event(Severity.WARNING, "RTL refused: home is not known"), *events)
    state, events = modes.enter(state, modes.RTL)
    return guidance.hold_current(state, config), events


def _begin_leg(item: MissionItem, state: AutopilotState, config: Config) -> AutopilotState:
    """Set the path to the position of an item.

    A line starts at the last waypoint if the vehicle is within NAV_LOS_M of it, else at the
    vehicle's position. An item without a position means the vehicle's position.
    """
    vehicle_m = guidance.position_of(state.estimate)
    position_m = guidance.item_position(item, state.home)
    to_m = vehicle_m if position_m is None else position_m
    if item.command != MavCmd.NAV_LAND:  # its altitude is that at the end of the item
        depth_m = guidance.item_depth_m(item, state.setpoint.depth_m)
        state = state._replace(setpoint=state.setpoint._replace(depth_m=depth_m))
    if item.command in (MavCmd.NAV_WAYPOINT, MavCmd.NAV_LAND):
        from_m = state.mission.previous_waypoint_m
        near = from_m is not None and abs(vehicle_m - from_m) <= config.lookahead_m
        return state._replace(
            path=TrackLine(from_m if from_m is not None and near else vehicle_m, to_m)
        )
    return state._replace(path=guidance.circle(to_m, item.p3, config))


def _start_waypoint_orbit(
    item: MissionItem, state: AutopilotState, config: Config
) -> AutopilotState:
    """Circle a waypoint with a hold time once it is reached: the vehicle cannot hover."""
    path = state.path
    if item.command != MavCmd.NAV_WAYPOINT or not item.p1 > 0.0 or not isinstance(path, TrackLine):
        return state
    if not guidance.reached(path, state.estimate, acceptance_m(item, config)):
        return state
    return state._replace(path=guidance.circle(path.to_m, 0.0, config, since_us=state.time_us))


def acceptance_m(item: MissionItem, config: Config) -> float:
    """Return the acceptance radius: p2 of a waypoint if given, else NAV_ACC_RAD_M."""
    given = item.p2 if item.command == MavCmd.NAV_WAYPOINT else 0.0
    return given if given > 0.0 else config.acceptance_m


def item_done(item: MissionItem, state: AutopilotState, config: Config) -> bool:
    """Return whether an item in progress is done."""
    path, entered_us = state.path, state.mission.entered_us
    match item.command:
        case MavCmd.NAV_DELAY:
            return (
                state.time_us - (state.time_us if entered_us is None else entered_us)
            ) / US_PER_S >= item.p1
        case MavCmd.CONDITION_CHANGE_ALT:
            return abs(state.estimate.depth_m - new_depth_m(item)) < DEPTH_REACHED_M
        case MavCmd.USER_1:
            return state.test is None
        case MavCmd.NAV_LOITER_UNLIM:
            return False
    if isinstance(path, TrackLine):
        return guidance.reached(path, state.estimate, acceptance_m(item, config))
    if isinstance(path, Circle):
        turns = item.command == MavCmd.NAV_LOITER_TURNS
        return (
            path.swept_rad >= 2.0 * math.pi * item.p1 if turns else _orbit_done(path, item, state)
        )
    return True


def _orbit_done(path: Circle, item: MissionItem, state: AutopilotState) -> bool:
    """Return whether the vehicle has circled for p1 seconds."""
    return path.since_us is not None and guidance.orbit_time_s(path, state.time_us) >= item.p1


def excitation_of(item: MissionItem, state: AutopilotState, config: Config) -> Excitation:
    """Return the test of a MAV_CMD_USER_1 item (x: duration in whole seconds, y: wave, z: fade)."""
    fade_s = 0.0 if math.isnan(item.z) else item.z
    request = excitation.from_numbers(
        int(item.p1), item.p2, item.p3, item.p4, float(item.x), item.y, fade_s
    )
    return excitation.precompute(request, state, config)


def start_test(test: Excitation, state: AutopilotState) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Start a test and report it."""
    return state._replace(test=test), (
        Event(Severity.INFO, f"SystemID Starting: {excitation.describe(test)}"),
    )


def items_to_fly(items: tuple[MissionItem, ...], config: Config) -> tuple[MissionItem, ...]:
    """Return the items without item 0 if that is home (MIS_SEQ0_HOME)."""
    return items[1:] if config.mission_seq0_home else items


def _advance_item(item: MissionItem, state: AutopilotState) -> AutopilotState:
    """Complete an item and move to the next, or to the target of a jump."""
    mission = state.mission
    index, jumps = mission.current + 1, mission.jumps
    if item.command == MavCmd.DO_JUMP:
        position = bisect_left(jumps, (item.sequence,))
        count = (
            jumps[position][1]
            if position < len(jumps) and jumps[position][0] == item.sequence
            else 0
        )
        if item.p2 < 0 or count < item.p2:
            index = int(item.p1)
            jumps = (
                *jumps[:position],
                (item.sequence, count + 1),
                *jumps[position + (count > 0) :],
            )
    return state._replace(
        mission=mission._replace(
            current=index,
            entered_us=None,
            jumps=jumps,
            reached=item.sequence,
            previous_waypoint_m=_last_waypoint_m(item, state),
        )
    )


def _last_waypoint_m(item: MissionItem, state: AutopilotState) -> complex | None:
    """Return the last waypoint that was reached, after completing an item."""
    if item.command == MavCmd.NAV_WAYPOINT and isinstance(state.path, TrackLine):
        return state.path.to_m
    return state.mission.previous_waypoint_m


def _complete(state: AutopilotState, config: Config) -> tuple[AutopilotState, tuple[Event, ...]]:
    """End a mission with the action of MIS_END_ACT."""
    event = Event(Severity.INFO, "Mission complete")
    if config.mission_end == 2:
        return modes.disarm(state), (event, Event(Severity.INFO, "Disarmed"))
    state, events = modes.enter(state, modes.SURFACE if config.mission_end == 1 else modes.HOLD)
    return state, (event, *events)


def new_depth_m(item: MissionItem) -> float:
    """Return the depth of an item with a depth or an altitude.

    Parameters
    ----------
    item : MissionItem
        DO_CHANGE_ALTITUDE, or an item with a position.

    Returns
    -------
    float
        Depth (m); 0 if the item has none.
    """
    return (
        -item.p1 if item.command == MavCmd.DO_CHANGE_ALTITUDE else guidance.item_depth_m(item, 0.0)
    )


def _heading(item: MissionItem, state: AutopilotState) -> float:
    """Return the heading (rad) of a YAW item; p4 = 1: relative, clockwise unless p3 < 0."""
    angle = math.radians(item.p1)
    if item.p4 == 1:
        return wrap_pi(state.setpoint.heading_rad + (-angle if item.p3 < 0 else angle))
    return wrap_pi(angle)


def item_thrust(item: MissionItem, thrust: float, config: Config) -> float:
    """Return the thrust of CHANGE_SPEED: p3 (%) if given, else that of speed p2; -2: cruise.

    A thrust of 0 beside a speed is not given: MAVProxy and pymavlink leave unused parameters 0.
    """
    speed_is_given = item.p2 >= 0 or item.p2 == -2
    if item.p3 > 0 or (item.p3 == 0 and not speed_is_given):
        return min(1.0, item.p3 / 100.0)
    if item.p2 >= 0:
        return offboard.thrust_for(item.p2, config)
    return config.cruise_thrust_pct / 100.0 if item.p2 == -2 else thrust
