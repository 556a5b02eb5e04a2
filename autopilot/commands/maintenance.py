"""Maintenance commands for a disarmed vehicle: restart, parameter reset and calibration."""

import math

from autopilot.commands.types import CommandContext, CommandResult, Handler, MavCommand
from autopilot.comms.stream_rates import Schedule
from autopilot.control import requests
from autopilot.control.params import ParamError
from autopilot.control.types import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
from mavlink_io.frames import STANDARD_GRAVITY_MPS2
from mavlink_io.mission_items import MavCmd

_READ, _WRITE, _RESET, _FACTORY_RESET = 0, 1, 2, 4
"""Values of PREFLIGHT_STORAGE.param1."""
_SAVE = -1
_CLEAR = 2
_PA_PER_HPA = 100.0
MAX_PRESSURE_CHANGE_HPA = 60.0
"""Largest plausible change of air pressure; a larger one means that the vehicle is submerged."""
GROUND_PRESSURE = "EST_SURF_HPA"
"""Parameter of the air pressure at the surface."""


def reboot(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """PREFLIGHT_REBOOT_SHUTDOWN: reset the state; shutdown is not supported."""
    if context.vehicle.state.armed:
        return context.refuse(TEMPORARILY_REJECTED, "Reboot refused: armed")
    if command.p1 not in (0, 1):
        return context.refuse(
            UNSUPPORTED, "Shutdown refused: the autopilot does not control its computer"
        )
    if command.p1 == 1:
        context.vehicle.restart("requested by ground")
    return CommandResult(ACCEPTED)


def store(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """PREFLIGHT_STORAGE: reset parameters to their defaults; reading and writing is automatic."""
    if context.vehicle.state.armed:
        return context.refuse(TEMPORARILY_REJECTED, "Storage refused: armed")
    if command.p1 in (_RESET, _FACTORY_RESET):
        for name in context.vehicle.params.reset():
            context.publish_parameter(name)
        context.accept_with_notice("Parameters reset to defaults")
    elif not (command.p1 in (_READ, _WRITE, _SAVE) or math.isnan(command.p1)):
        return context.refuse(
            DENIED, f"PREFLIGHT_STORAGE: param1 is {command.p1:g}, must be 0, 1, 2 or 4"
        )
    if command.p2 == _CLEAR:
        return context.ask(requests.LoadMission(()))
    return CommandResult(ACCEPTED)


def calibrate(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """PREFLIGHT_CALIBRATION of the ground pressure (param3): the present depth becomes zero.

    Pressure change (hPa) = depth (m) * density (kg/m3) * g (m/s2) / 100.
    """
    requested = [n for n, p in enumerate(command[1:8], 1) if math.isfinite(p) and p != 0.0]
    if not requested:
        return CommandResult(ACCEPTED)
    if requested != [3] or command.p3 != 1.0:
        text = (
            "Calibration: only param3 = 1 (ground pressure); gyro, accelerometer and compass are"
            " corrected automatically"
        )
        return context.refuse(DENIED, text)
    state, params = context.vehicle.state, context.vehicle.params
    if state.armed or not state.estimate.initialised:
        return context.refuse(TEMPORARILY_REJECTED, "Calibration refused: armed, or no sensors yet")
    per_m_hpa = params.config.water_density_kgpm3 * STANDARD_GRAVITY_MPS2 / _PA_PER_HPA
    change_hpa = state.estimate.depth_m * per_m_hpa
    if abs(change_hpa) > MAX_PRESSURE_CHANGE_HPA:
        return context.refuse(
            TEMPORARILY_REJECTED,
            f"Calibration refused: {change_hpa:+.0f} hPa exceeds {MAX_PRESSURE_CHANGE_HPA:.0f} hPa",
        )
    try:
        now_hpa = params.set(GROUND_PRESSURE, params.get(GROUND_PRESSURE) + change_hpa)
    except ParamError as refusal:
        return context.refuse(DENIED, f"Calibration refused: {refusal}")
    context.publish_parameter(GROUND_PRESSURE)
    return context.accept_with_notice(f"Ground pressure is {now_hpa:.1f} hPa")


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: reboot,
    MavCmd.PREFLIGHT_STORAGE: store,
    MavCmd.PREFLIGHT_CALIBRATION: calibrate,
}
