"""Commands that move the vehicle: arming, modes, the mission, new targets, home."""

import math
from dataclasses import replace
from functools import partial

from autopilot.commands.types import (
    CommandResult,
    Desk,
    Handler,
    MavCommand,
    custom_mode,
    foreign_mode,
    integer_parameter,
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
from autopilot.telemetry import streams
from mavlink_io.mission_items import FRAME_MISSION, MavCmd, MissionItem

_FORCE = 21_196
"""COMPONENT_ARM_DISARM.param2 that skips the checks."""
_PAUSE, _CONTINUE = 0, 1
_CHANGE_MODE = 1
"""DO_REPOSITION.param2: leave the mode for one that goes to the place."""


def arm(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    force = command.p2 == _FORCE
    if command.p1 == 1:
        return desk.ask(requests.Arm(force))
    if command.p1 == 0:
        return desk.ask(requests.Disarm(force))
    return desk.refuse(DENIED, f"Arming: param1 is {command.p1:g}, must be 1 or 0")


def set_mode(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    if not integer_parameter(command.p1) & 1:
        return desk.refuse(DENIED, "DO_SET_MODE: param1 lacks the custom mode flag (1)")
    number = custom_mode(command)
    if number is None:
        return desk.refuse(DENIED, foreign_mode(integer_parameter(command.p2)))
    return desk.ask(requests.SetMode(number))


def set_standard_mode(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    for mode in modes.MODES:
        if mode.standard_mode and mode.standard_mode == command.p1:
            return desk.ask(requests.SetMode(mode.number))
    return desk.refuse(FAILED, f"Standard mode {command.p1:g} is not one this vehicle has")


def enter(mode: modes.Mode, desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    return desk.ask(requests.SetMode(mode.number))


def start_mission(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    if first := integer_parameter(command.p1):
        outcome = desk.ask(requests.SetMissionItem(first))
        if outcome.result != ACCEPTED:
            return outcome
    return desk.ask(requests.SetMode(modes.MISSION.number))


def set_mission_item(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    return desk.ask(requests.SetMissionItem(integer_parameter(command.p1, -1)))


def pause(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    if command.p1 not in (_PAUSE, _CONTINUE):
        return desk.refuse(DENIED, f"DO_PAUSE_CONTINUE: param1 is {command.p1:g}, must be 0 or 1")
    mode = modes.MISSION if command.p1 == _CONTINUE else modes.HOLD
    return desk.ask(requests.SetMode(mode.number))


def reposition(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """Without a place it is the pause button of QGroundControl's PX4 personality."""
    if (
        math.isfinite(command.p5)
        or math.isfinite(command.p6)
        or not integer_parameter(command.p2) & _CHANGE_MODE
    ):
        return desk.refuse(
            UNSUPPORTED,
            "DO_REPOSITION: only without a place, to hold; fly a mission to go somewhere",
        )
    return desk.ask(requests.SetMode(modes.HOLD.number))


def change_target(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """A leg's command means the same now as it does in a mission."""
    c = command
    if c.number != MavCmd.DO_CHANGE_SPEED and not math.isfinite(c.p1):
        return desk.refuse(DENIED, f"Command {c.number}: param1 is not given")
    item = MissionItem(0, FRAME_MISSION, c.number, p1=c.p1, p2=c.p2, p3=c.p3, p4=c.p4)
    vehicle, config = desk.vehicle, desk.vehicle.params.config
    _, wrong = mission.check((item,), replace(config, mission_seq0_home=0))
    if wrong:
        return desk.refuse(DENIED, f"Command {c.number}: {wrong}")
    if not vehicle.state.armed:
        return desk.refuse(TEMPORARILY_REJECTED, f"Command {c.number} refused: not armed")
    wanted = mission.begin_item(item, vehicle.state, config)[0].setpoint
    return desk.ask(requests.ChangeTarget(wanted.depth_m, wanted.heading_rad, wanted.thrust))


def set_home(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """Home may be moved, never lifted from the surface: depth is counted from there."""
    scale = 1e-7 if command.scaled else 1.0
    lat_deg, lon_deg = command.p5 * scale, command.p6 * scale
    if command.p1 == 1:
        if not desk.vehicle.state.home.known:
            return desk.refuse(TEMPORARILY_REJECTED, "Home refused: the position is not known")
        lat_deg, lon_deg = (angle * 1e-7 for angle in streams.position_dege7(desk.vehicle.state))
    return move_home(desk, lat_deg, lon_deg, command.p7)


def move_home(desk: Desk, lat_deg: float, lon_deg: float, altitude_m: float) -> CommandResult:
    """Put home at a place of the surface, whatever altitude somebody has in mind."""
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        return desk.refuse(DENIED, f"Home refused: {lat_deg:g}, {lon_deg:g} is no place")
    home = desk.vehicle.state.home
    if lat_deg == lon_deg == 0.0 and home.known and not guidance.near_zero_zero(home):
        return desk.refuse(
            DENIED, "Home refused: 0, 0 counts as no place unless home is within 100 km of it"
        )
    outcome = desk.ask(requests.SetHome(lat_deg, lon_deg))
    if not math.isnan(altitude_m) and altitude_m != 0.0:
        desk.vehicle.say("Home stays at the surface: altitude ignored", Severity.NOTICE)
    return outcome


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.COMPONENT_ARM_DISARM: arm,
    MavCmd.DO_SET_MODE: set_mode,
    MavCmd.DO_SET_STANDARD_MODE: set_standard_mode,
    MavCmd.MISSION_START: start_mission,
    MavCmd.DO_SET_MISSION_CURRENT: set_mission_item,
    MavCmd.DO_PAUSE_CONTINUE: pause,
    MavCmd.DO_REPOSITION: reposition,
    MavCmd.NAV_RETURN_TO_LAUNCH: partial(enter, modes.RTL),
    MavCmd.NAV_LAND: partial(enter, modes.SURFACE),
    MavCmd.NAV_LOITER_UNLIM: partial(enter, modes.HOLD),
    MavCmd.CONDITION_YAW: change_target,
    MavCmd.DO_CHANGE_ALTITUDE: change_target,
    MavCmd.DO_CHANGE_SPEED: change_target,
    MavCmd.DO_SET_HOME: set_home,
}
