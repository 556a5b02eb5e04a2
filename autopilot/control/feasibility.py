"""Feasibility of a whole mission: items, geofence with the lines between places, floor, battery.

Pure. The battery is that of cruise for as long as the mission lasts: the time of a line is its
length over the speed, and the load at another speed u than cruise u_c is max(1, (u / u_c)^3), as
drive power grows with the cube of the speed. Currents are not considered.
"""

import math
from typing import NamedTuple

from autopilot.control import fence, guidance, mission, offboard
from autopilot.control.jumps import Jumps
from autopilot.control.mission import MissionFault
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState, Home, MissionState
from mavlink_io.mission_items import LENGTH_ROUNDING_M, MavCmd, MissionItem

MAX_ITEMS = 10_000
"""Maximum number of items that are followed, those that a jump repeats included."""
_NO_TIME = frozenset((MavCmd.DO_CHANGE_ALTITUDE, MavCmd.CONDITION_YAW))
"""Commands that end at once and leave the vehicle where it is."""
_PLACE_PARAMETER, _DEPTH_PARAMETER, _TIME_PARAMETER, _RADIUS_PARAMETER = 5, 7, 1, 3
"""Numbers of the parameters with these quantities in MAV_MISSION_RESULT."""
_ALTITUDE_PARAMETER = 1
"""Number of the parameter of DO_CHANGE_ALTITUDE with the altitude."""


class MissionStart(NamedTuple):
    """Place at which a mission starts or resumes."""

    position_m: complex
    """North + i east from home (m)."""
    floor_m: float = math.inf
    """Depth of the sea floor there; infinite or NaN if it is not known."""


class _Progress(NamedTuple):
    """Expected state of the vehicle while the items are followed."""

    position_m: complex | None
    """None before the first place."""
    on_place: bool
    """Whether the vehicle is at this position, and not on a course from there."""
    depth_m: float
    thrust: float
    used_s: float = 0.0
    """Time at the load of cruise."""


def find_fault(
    state: AutopilotState,
    items: tuple[MissionItem, ...],
    config: Config,
    start: MissionStart | None,
) -> MissionFault | None:
    """Return the first fault of a mission, None if it can be flown.

    Parameters
    ----------
    state : AutopilotState
        State with home, geofence, charge of the battery, and the progress of the mission.
    items : tuple of MissionItem
        Items of the mission.
    config : Config
        Parameters.
    start : MissionStart or None
        Where the mission starts at its current item; None for an upload.

    Returns
    -------
    MissionFault or None
        Item, reason with value and limit, and number of the wrong parameter.
    """
    if fault := mission.find_fault(items, state.home, config):
        return fault
    if fault := find_fence_fault(items, state.fence, state.home, config):
        return fault
    progress = mission.restart(MissionState(items), config)
    if start is not None and 0 < state.mission.current < len(items):
        progress = state.mission._replace(items=items)
    return _follow(progress, state, config, start)


def start_of(state: AutopilotState) -> MissionStart:
    """Return the present place, and the floor under it that the altimeter measures."""
    estimate = state.estimate
    return MissionStart(guidance.position_of(estimate), estimate.depth_m + estimate.altitude_m)


def find_fence_fault(
    items: tuple[MissionItem, ...], zones: fence.Fence, home: Home, config: Config
) -> MissionFault | None:
    """Return the first item whose position or depth the geofence forbids, None if there is none.

    Parameters
    ----------
    items : tuple of MissionItem
        Items of a mission.
    zones : Fence
        Geofence.
    home : Home
        Home; positions are not checked while it is unknown.
    config : Config
        Parameters with the depth band.
    """
    for item in mission.items_to_fly(items, config):
        if (depth_m := mission.wanted_depth_m(item)) is not None:
            parameter = _depth_parameter(item)
            limit = ""
            if 0.0 < config.fence_max_m < depth_m - LENGTH_ROUNDING_M:
                limit = f"at most FENCE_DPT_MAX = {config.fence_max_m:g} m"
            elif depth_m + LENGTH_ROUNDING_M < config.fence_min_m:
                limit = f"at least FENCE_DPT_MIN = {config.fence_min_m:g} m"
            if limit:
                reason = f"depth {depth_m:g} m: must be {limit}"
                return MissionFault(item.sequence, reason, parameter)
        if item.command not in mission.POSITION_COMMANDS or not home.known:
            continue
        position_m = guidance.item_position(item, home)
        if position_m is not None and (
            text := fence.breach(zones, position_m, (home.lat_deg, home.lon_deg))
        ):
            return MissionFault(item.sequence, f"geofence: {text}", _PLACE_PARAMETER)
    return None


def _follow(
    plan: MissionState, state: AutopilotState, config: Config, start: MissionStart | None
) -> MissionFault | None:
    """Follow the items from the current one; return the first that cannot be reached."""
    place = None if start is None else start.position_m
    now = _Progress(place, start is not None, state.estimate.depth_m, _cruise_thrust(config))
    available_s = _battery_s(state, config)
    lines: set[tuple[complex, complex]] = set()
    circles: set[tuple[complex, float]] = set()
    jumps = Jumps(plan.jumps, available_s)
    index = plan.current
    for _ in range(MAX_ITEMS):
        if index >= len(plan.items):
            return None
        item = plan.items[index]
        index += 1
        if item.command == MavCmd.DO_JUMP:
            jump = jumps.take(item, now._replace(used_s=0.0), now.used_s)
            if jump is None or isinstance(jump, MissionFault):
                return jump
            index, now = jump.target, now._replace(used_s=now.used_s + jump.skipped_s)
            continue
        after = _after(item, now, state, config)
        if fault := _line_fault(item, now, after, lines, state):
            return fault
        if fault := _circle_fault(item, after, circles, state, config):
            return fault
        if start and (fault := _floor_fault(item, after, start, config)):
            return fault
        if math.isinf(after.used_s):
            return _battery_fault(item, after.used_s, available_s, state)
        if after.used_s > available_s:
            if jumps.repeats_endlessly:
                return None  # ends by the battery failsafe
            return _battery_fault(item, after.used_s, available_s, state)
        if item.command in (
            MavCmd.NAV_LAND,
            MavCmd.NAV_RETURN_TO_LAUNCH,
            MavCmd.NAV_LOITER_UNLIM,
        ):
            return None
        now = after
    reason = f"more than {MAX_ITEMS} items with those that its jumps repeat"
    return MissionFault(plan.items[index - 1].sequence, reason, 0)


def _after(item: MissionItem, now: _Progress, state: AutopilotState, config: Config) -> _Progress:
    """Return the expected state after an item; the time is infinite without thrust."""
    depth_m = mission.wanted_depth_m(item)
    after = now._replace(depth_m=now.depth_m if depth_m is None else depth_m)
    if item.command == MavCmd.DO_CHANGE_SPEED:
        return after._replace(thrust=mission.item_thrust(item, now.thrust, config))
    if item.command in _NO_TIME:
        return after
    cruise = _cruise_thrust(config)
    relative_speed = now.thrust / cruise if cruise > 0.0 else 1.0
    speed_mps = relative_speed * config.cruise_speed_mps
    load = max(1.0, relative_speed**3)
    length_m, wait_s = 0.0, _wait_s(item)
    place_m = _place_m(item, now, state)
    if place_m is not None:
        after = after._replace(position_m=place_m, on_place=True)
        if now.position_m is not None:
            length_m = math.hypot(abs(place_m - now.position_m), after.depth_m - now.depth_m)
    elif item.command == MavCmd.CONDITION_CHANGE_ALT:
        length_m = abs(after.depth_m - now.depth_m) / math.sin(config.pitch_limit_rad)
    if item.command == MavCmd.NAV_LOITER_TURNS:
        radius_m = guidance.circle(0j, item.p3, config).radius_m
        length_m += 2.0 * math.pi * radius_m * max(0.0, item.p1)
    if item.command not in mission.POSITION_COMMANDS:
        after = after._replace(on_place=False)
    if length_m > 0.0:
        wait_s += length_m / speed_mps if speed_mps > 0.0 else math.inf
    return after._replace(used_s=now.used_s + load * wait_s)


def _place_m(item: MissionItem, now: _Progress, state: AutopilotState) -> complex | None:
    """Return the place that an item leads to; None if it leads to none."""
    if item.command == MavCmd.NAV_RETURN_TO_LAUNCH:
        return guidance.return_point(state)
    if item.command not in mission.POSITION_COMMANDS:
        return None
    position_m = guidance.item_position(item, state.home)
    return now.position_m if position_m is None else position_m


def _wait_s(item: MissionItem) -> float:
    """Return the time that an item asks for itself (s)."""
    if item.command in (MavCmd.NAV_DELAY, MavCmd.NAV_LOITER_TIME, MavCmd.NAV_WAYPOINT):
        return max(0.0, item.p1) if math.isfinite(item.p1) else 0.0
    return float(max(0, item.x)) if item.command == MavCmd.USER_1 else 0.0


def _line_fault(
    item: MissionItem,
    now: _Progress,
    after: _Progress,
    lines: set[tuple[complex, complex]],
    state: AutopilotState,
) -> MissionFault | None:
    """Return the fault of a line that leaves the geofence; each line is checked once."""
    if not (now.on_place and after.on_place and state.fence.zones and state.home.known):
        return None
    if now.position_m is None or after.position_m is None:
        return None
    line = now.position_m, after.position_m
    if line in lines:
        return None
    lines.add(line)
    text = fence.line_breach(state.fence, *line, (state.home.lat_deg, state.home.lon_deg))
    if not text:
        return None
    return MissionFault(item.sequence, f"geofence: the line to it is {text}", _PLACE_PARAMETER)


def _circle_fault(
    item: MissionItem,
    after: _Progress,
    circles: set[tuple[complex, float]],
    state: AutopilotState,
    config: Config,
) -> MissionFault | None:
    """Return the fault of a circle that leaves the geofence; each circle is checked once."""
    radius_m, centre_m = mission.circle_radius_m(item, config), after.position_m
    if not (radius_m and after.on_place and state.fence.zones and state.home.known):
        return None
    if centre_m is None or (centre_m, radius_m) in circles:
        return None
    circles.add((centre_m, radius_m))
    home_deg = state.home.lat_deg, state.home.lon_deg
    text = fence.circle_breach(state.fence, centre_m, radius_m, home_deg)
    if not text:
        return None
    own = item.command in mission.CIRCLE_COMMANDS and item.p3 and math.isfinite(item.p3)
    parameter = _RADIUS_PARAMETER if own else _PLACE_PARAMETER
    reason = f"geofence: a part of its circle of {radius_m:g} m is {text}"
    return MissionFault(item.sequence, reason, parameter)


def _floor_fault(
    item: MissionItem, after: _Progress, start: MissionStart, config: Config
) -> MissionFault | None:
    """Return the fault of a depth below the floor, at the place where the floor is measured."""
    lowest_m = start.floor_m - config.fs_altitude_m
    here = after.position_m is None or (
        abs(after.position_m - start.position_m) <= config.station_radius_m
    )
    depth_m = mission.wanted_depth_m(item)
    if depth_m is None or not here or not after.on_place or not depth_m > lowest_m:
        return None  # an unknown floor is NaN
    reason = f"depth {depth_m:g} m: the floor is at {start.floor_m:.1f} m, keep FS_ALT_M above it"
    return MissionFault(item.sequence, reason, _depth_parameter(item))


def _depth_parameter(item: MissionItem) -> int:
    """Return the number of the parameter that holds the depth of an item."""
    is_altitude = item.command == MavCmd.DO_CHANGE_ALTITUDE
    return _ALTITUDE_PARAMETER if is_altitude else _DEPTH_PARAMETER


def _battery_s(state: AutopilotState, config: Config) -> float:
    """Return the time at cruise until the battery is low (s); infinite if it is not known."""
    if config.battery_cruise_h == 0.0:
        return math.inf
    reserve = config.fs_battery_pct / 100.0 if config.fs_battery_action else 0.0
    return max(0.0, state.charge - reserve) * config.battery_cruise_h * 3600.0


def _battery_fault(
    item: MissionItem, used_s: float, available_s: float, state: AutopilotState
) -> MissionFault:
    """Return the fault of an item that the vehicle cannot complete."""
    moves = item.command in mission.POSITION_COMMANDS
    parameter = _PLACE_PARAMETER if moves and _wait_s(item) == 0.0 else _TIME_PARAMETER
    if item.command == MavCmd.CONDITION_CHANGE_ALT:
        parameter = _DEPTH_PARAMETER
    if item.command == MavCmd.NAV_LOITER_TURNS:
        parameter = _TIME_PARAMETER
    if item.command in (MavCmd.NAV_RETURN_TO_LAUNCH, MavCmd.USER_1):
        parameter = 0
    if math.isinf(used_s):
        return MissionFault(item.sequence, "it is never reached: the thrust is 0", parameter)
    reason = (
        f"needs {used_s / 3600.0:.3g} h of the battery at cruise: must be at most"
        f" {available_s / 3600.0:.3g} h ({100.0 * state.charge:.0f} % of BAT_CRUISE_H, less the"
        " reserve)"
    )
    return MissionFault(item.sequence, reason, parameter)


def _cruise_thrust(config: Config) -> float:
    """Return the thrust of cruise speed (fraction of full)."""
    return offboard.thrust_for(config.cruise_speed_mps, config)
