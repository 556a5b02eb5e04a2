"""Commands for flight: arming, modes, mission, set-points and home."""

import math
from dataclasses import replace
from functools import partial

from autopilot.commands.types import (
    CommandContext,
    CommandResult,
    Handler,
    MavCommand,
    custom_mode,
    integer_parameter,
    unknown_mode_text,
)
from autopilot.comms.stream_rates import Schedule
from autopilot.control import guidance, mission, modes, requests
from autopilot.control.types import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Severity,
)
from autopilot.telemetry import tick_messages
from mavlink_io import dialect
from mavlink_io.frames import wrap_pi
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    NOT_GIVEN,
    MavCmd,
    MissionItem,
)

_FORCE, _FORCE_ARM = 21_196, 2_989
"""Values of COMPONENT_ARM_DISARM.param2 that skip the checks; the second, which ArduPilot's tools
and QGroundControl send, when arming only."""
_PAUSE, _CONTINUE = 0, 1
"""Values of DO_PAUSE_CONTINUE.param1."""
_CURRENT_ITEM = -1
"""Value of DO_SET_MISSION_CURRENT.param1 for the current item."""
_NO_ITEM = -2
"""Number of no item, for a param1 that is not given or no number of an item."""
_CHANGE_MODE, _COUNTER_CLOCKWISE = 1, 1
"""Bit of DO_REPOSITION.param2: change the mode; value of its param4 for a vehicle that circles."""
_HEADING_ALONG_CIRCLE = (3, 5)
"""ORBIT_YAW_BEHAVIOUR values that a vehicle can follow that circles: tangent, unchanged."""


def arm(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """COMPONENT_ARM_DISARM: arm (1) or disarm (0); param2 = 21196 skips the checks."""
    if command.p1 == 1:
        return context.ask(requests.Arm(command.p2 in (_FORCE, _FORCE_ARM)))
    if command.p1 == 0:
        return context.ask(requests.Disarm(command.p2 == _FORCE))
    return context.refuse(DENIED, f"Arming: param1 is {command.p1:g}, must be 1 or 0")


def set_mode(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """DO_SET_MODE with a custom mode."""
    if not integer_parameter(command.p1) & 1:
        return context.refuse(DENIED, "DO_SET_MODE: param1 lacks the custom mode flag (1)")
    number = custom_mode(command, context.mode_table)
    if number is None:
        return context.refuse(DENIED, unknown_mode_text(integer_parameter(command.p2)))
    mode = context.mode_table.selected(number)
    if mode is None:
        names = ", ".join(map(context.mode_table.name, context.mode_table.listed))
        return context.refuse(UNSUPPORTED, f"Mode {number} is none of {names}")
    return context.ask(requests.SetMode(mode.number))


def set_standard_mode(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """DO_SET_STANDARD_MODE: select the mode with a MAVLink standard mode."""
    for mode in modes.MODES:
        if mode.standard_mode and mode.standard_mode == command.p1:
            return context.ask(requests.SetMode(mode.number))
    return context.refuse(FAILED, f"Standard mode {command.p1:g} is not supported")


def enter(
    mode: modes.Mode, context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """Select a mode; handler of commands that each mean one mode."""
    return context.ask(requests.SetMode(mode.number))


def start_mission(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """MISSION_START: fly the mission, from the item of param1 if it is not 0."""
    if first := integer_parameter(command.p1):
        outcome = context.ask(requests.SetMissionItem(first))
        if outcome.result != ACCEPTED:
            return outcome
    return context.ask(requests.SetMode(modes.MISSION.number))


def set_mission_item(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """DO_SET_MISSION_CURRENT: continue at the item of param1, and send MISSION_CURRENT.

    param1 = -1: the current item, which is not started again; param2 = 1: reset the mission.
    """
    if not math.isnan(command.p2) and command.p2 not in (0.0, 1.0):
        return context.refuse(
            DENIED, f"DO_SET_MISSION_CURRENT: param2 is {command.p2:g}, must be 0 or 1"
        )
    sequence = integer_parameter(command.p1, _NO_ITEM)
    outcome = context.ask(
        requests.SetMissionItem(
            None if sequence == _CURRENT_ITEM else sequence, reset=command.p2 == 1.0
        )
    )
    if outcome.result != ACCEPTED:
        return outcome
    message = dialect.by_name("MISSION_CURRENT")
    return outcome._replace(messages=tuple((message, v) for v in context.build(message)))


def pause(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """DO_PAUSE_CONTINUE: HOLD (0) or MISSION (1)."""
    if command.p1 not in (_PAUSE, _CONTINUE):
        return context.refuse(
            DENIED, f"DO_PAUSE_CONTINUE: param1 is {command.p1:g}, must be 0 or 1"
        )
    mode = modes.MISSION if command.p1 == _CONTINUE else modes.HOLD
    return context.ask(requests.SetMode(mode.number))


def reposition(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """DO_REPOSITION: circle a place in STATION; without a place a new depth, or HOLD.

    param1: speed (m/s), param3: radius of the circle (m), param4 = 1: counter-clockwise. Another
    heading cannot be held, as the vehicle circles; in HOLD param4 is the new heading (rad).
    """
    changes_mode = bool(integer_parameter(command.p2) & _CHANGE_MODE)
    if all(math.isnan(value) for value in (command.p5, command.p6)):
        if math.isnan(command.p7):
            if not changes_mode:
                return context.refuse(DENIED, "DO_REPOSITION: neither a place nor a depth is given")
            return _hold(context, command.p4)
        return go_to(context, command, MavCmd.CONDITION_CHANGE_ALT, changes_mode=changes_mode)
    sense = -1.0 if command.p4 == _COUNTER_CLOCKWISE else 1.0
    radius_m = sense * abs(command.p3)
    return go_to(
        context, command, MavCmd.NAV_LOITER_UNLIM, radius_m=radius_m, changes_mode=changes_mode
    )


def _hold(context: CommandContext, heading_rad: float) -> CommandResult:
    """Select HOLD, with a new heading if it is given."""
    outcome = context.ask(requests.SetMode(modes.HOLD.number))
    if outcome.result == ACCEPTED and math.isfinite(heading_rad):
        context.ask(requests.ChangeTarget(heading_rad=wrap_pi(heading_rad)))
    return outcome


def orbit(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """DO_ORBIT: circle a place in STATION; param1: radius (m), negative for counter-clockwise."""
    if command.p4 > 0.0:
        return context.refuse(DENIED, "DO_ORBIT: param4 must be 0, the number of orbits is endless")
    outcome = go_to(
        context,
        command._replace(p1=command.p2),
        MavCmd.NAV_LOITER_UNLIM,
        radius_m=command.p1,
        changes_mode=True,
    )
    free = command.p3 in _HEADING_ALONG_CIRCLE or math.isnan(command.p3)
    if outcome.result == ACCEPTED and not free:
        return context.accept_with_notice("DO_ORBIT: the bow points along the circle")
    return outcome


def go_to(
    context: CommandContext,
    command: MavCommand,
    item: MavCmd,
    *,
    radius_m: float = math.nan,
    changes_mode: bool,
) -> CommandResult:
    """Ask for the place and the depth of a command; param1 is the speed, not above 0 for cruise."""
    frame = command.frame
    if frame not in GLOBAL_FRAMES and frame != FRAME_LOCAL_NED:
        return context.refuse(DENIED, f"Go-to refused: frame {frame}; 0, 1, 3, 5, 6 are supported")
    x, y = _coordinate(command.p5, command.scaled), _coordinate(command.p6, command.scaled)
    home, depth_m = context.vehicle.state.home, command.p7
    if x == y == 0 and frame in GLOBAL_FRAMES and not guidance.near_zero_zero(home):
        return context.refuse(DENIED, "Go-to refused: 0, 0 is not a place near home")
    if frame in GLOBAL_FRAMES and 0.0 < depth_m <= context.vehicle.params.config.surfaced_depth_m:
        depth_m = 0.0  # a tool repeats the altitude of a vehicle at the surface
    place = MissionItem(0, frame, item, p3=radius_m, x=x, y=y, z=depth_m)
    speed_mps = command.p1 if command.p1 > 0.0 else None
    return context.ask(requests.GoTo(place, speed_mps, changes_mode))


def _coordinate(value: float, scaled: bool) -> int:
    """Return a coordinate in the unit of an item; NOT_GIVEN for NaN."""
    if not math.isfinite(value):
        return NOT_GIVEN
    limit = NOT_GIVEN - 1
    return round(max(-limit, min(limit, value if scaled else value * GLOBAL_SCALE)))


def refuse_because(reason: str) -> Handler:
    """Return the handler of a command without a meaning for this vehicle."""

    def refuse(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
        """Answer UNSUPPORTED and send the reason."""
        return context.refuse(UNSUPPORTED, reason)

    return refuse


def change_target(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """CONDITION_YAW, DO_CHANGE_ALTITUDE, DO_CHANGE_SPEED: change a set-point as in a mission."""
    c = command
    if c.number != MavCmd.DO_CHANGE_SPEED and not math.isfinite(c.p1):
        return context.refuse(DENIED, f"Command {c.number}: param1 is not given")
    item = MissionItem(0, FRAME_MISSION, c.number, p1=c.p1, p2=c.p2, p3=c.p3, p4=c.p4)
    vehicle, config = context.vehicle, context.vehicle.params.config
    _, error = mission.check((item,), replace(config, mission_seq0_home=0))
    if error:
        return context.refuse(DENIED, f"Command {c.number}: {error}")
    if not vehicle.state.armed:
        return context.refuse(TEMPORARILY_REJECTED, f"Command {c.number} refused: not armed")
    setpoint = mission.begin_item(item, vehicle.state, config)[0].setpoint
    return context.ask(
        requests.ChangeTarget(setpoint.depth_m, setpoint.heading_rad, setpoint.thrust)
    )


def set_home(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """DO_SET_HOME: set home at the surface, at a position or at the vehicle (param1 = 1)."""
    scale = 1e-7 if command.scaled else 1.0
    lat_deg, lon_deg = command.p5 * scale, command.p6 * scale
    if command.p1 == 1:
        state = context.vehicle.state
        if not state.home.known:
            return context.refuse(TEMPORARILY_REJECTED, "Home refused: the position is not known")
        lat_deg, lon_deg = (
            angle * 1e-7 for angle in tick_messages.position_dege7(state.estimate, state.home)
        )
    return move_home(context, lat_deg, lon_deg, command.p7)


def move_home(
    context: CommandContext, lat_deg: float, lon_deg: float, altitude_m: float
) -> CommandResult:
    """Set home at the surface; an altitude is ignored with a notice, as depth is relative to it."""
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        return context.refuse(DENIED, f"Home refused: {lat_deg:g}, {lon_deg:g} is not a position")
    home = context.vehicle.state.home
    if lat_deg == lon_deg == 0.0 and home.known and not guidance.near_zero_zero(home):
        return context.refuse(
            DENIED, "Home refused: 0, 0 means no position unless home is within 100 km of it"
        )
    outcome = context.ask(requests.SetHome(lat_deg, lon_deg))
    if not math.isnan(altitude_m) and altitude_m != 0.0:
        context.vehicle.send_statustext(
            "Home stays at the surface: altitude ignored", Severity.NOTICE
        )
    return outcome


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.COMPONENT_ARM_DISARM: arm,
    MavCmd.DO_SET_MODE: set_mode,
    MavCmd.DO_SET_STANDARD_MODE: set_standard_mode,
    MavCmd.MISSION_START: start_mission,
    MavCmd.DO_SET_MISSION_CURRENT: set_mission_item,
    MavCmd.DO_PAUSE_CONTINUE: pause,
    MavCmd.DO_REPOSITION: reposition,
    MavCmd.DO_ORBIT: orbit,
    MavCmd.NAV_TAKEOFF: refuse_because("Takeoff refused: an underwater vehicle dives in a mission"),
    MavCmd.DO_SET_RELAY: refuse_because("Relay refused: the vehicle has none"),
    MavCmd.DO_FLIGHTTERMINATION: refuse_because(
        "Termination refused: use SURFACE, or a forced disarm"
    ),
    MavCmd.NAV_RETURN_TO_LAUNCH: partial(enter, modes.RTL),
    MavCmd.NAV_LAND: partial(enter, modes.SURFACE),
    MavCmd.DO_LAND_START: partial(enter, modes.SURFACE),  # MAVProxy's ``land``
    MavCmd.NAV_LOITER_UNLIM: partial(enter, modes.HOLD),
    MavCmd.CONDITION_YAW: change_target,
    MavCmd.DO_CHANGE_ALTITUDE: change_target,
    MavCmd.DO_CHANGE_SPEED: change_target,
    MavCmd.DO_SET_HOME: set_home,
}
