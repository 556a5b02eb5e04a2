"""Commands for a vehicle that lies at the quay: restart, parameters back to their defaults,
calibration."""

import math

from autopilot.commands.types import CommandResult, Desk, Handler, MavCommand
from autopilot.comms.stream_rates import Schedule
from autopilot.control import requests
from autopilot.control.params import ParamError
from autopilot.control.types import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
from mavlink_io.frames import STANDARD_GRAVITY_MPS2
from mavlink_io.mission_items import MavCmd

_READ, _WRITE, _RESET, _FACTORY_RESET = 0, 1, 2, 4
"""PREFLIGHT_STORAGE.param1."""
_SAVE = -1
_CLEAR = 2
_PA_PER_HPA = 100.0
MAX_PRESSURE_CHANGE_HPA = 60.0
"""Air pressure differs by less from day to day; more is water."""
GROUND_PRESSURE = "EST_SURF_HPA"


def reboot(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    if desk.vehicle.state.armed:
        return desk.refuse(TEMPORARILY_REJECTED, "Reboot refused: armed")
    if command.p1 == 1:
        desk.vehicle.restart("asked by ground")
    return CommandResult(ACCEPTED if command.p1 in (0, 1) else UNSUPPORTED)


def store(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """Parameters are stored as they are set; what is left to ask for is their defaults."""
    if desk.vehicle.state.armed:
        return desk.refuse(TEMPORARILY_REJECTED, "Storage refused: armed")
    if command.p1 in (_RESET, _FACTORY_RESET):
        for name in desk.vehicle.params.reset():
            desk.tell_parameter(name)
        desk.remark("Parameters are at their defaults")
    elif not (command.p1 in (_READ, _WRITE, _SAVE) or math.isnan(command.p1)):
        return desk.refuse(
            DENIED, f"PREFLIGHT_STORAGE: param1 is {command.p1:g}, must be 0, 1, 2 or 4"
        )
    if command.p2 == _CLEAR:
        return desk.ask(requests.LoadMission(()))
    return CommandResult(ACCEPTED)


def calibrate(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """Only the air pressure needs it, at the surface: what the depth gauge reads now is depth
    zero."""
    wanted = [n for n, p in enumerate(command[1:8], 1) if math.isfinite(p) and p != 0.0]
    if not wanted:
        return CommandResult(ACCEPTED)
    if wanted != [3] or command.p3 != 1.0:
        text = (
            "Calibration: only param3 = 1, ground pressure; gyro, accelerometer and compass correct"
            " themselves"
        )
        return desk.refuse(DENIED, text)
    state, params = desk.vehicle.state, desk.vehicle.params
    if state.armed or not state.estimate.initialised:
        return desk.refuse(TEMPORARILY_REJECTED, "Calibration refused: armed, or no sensors yet")
    per_m_hpa = params.config.water_density_kgpm3 * STANDARD_GRAVITY_MPS2 / _PA_PER_HPA
    change_hpa = state.estimate.depth_m * per_m_hpa
    if abs(change_hpa) > MAX_PRESSURE_CHANGE_HPA:
        return desk.refuse(
            TEMPORARILY_REJECTED,
            f"Calibration refused: {change_hpa:+.0f} hPa is no change of weather",
        )
    try:
        now_hpa = params.set(GROUND_PRESSURE, params.get(GROUND_PRESSURE) + change_hpa)
    except ParamError as refusal:
        return desk.refuse(DENIED, f"Calibration refused: {refusal}")
    desk.tell_parameter(GROUND_PRESSURE)
    return desk.remark(f"Ground pressure is {now_hpa:.1f} hPa")


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.PREFLIGHT_REBOOT_SHUTDOWN: reboot,
    MavCmd.PREFLIGHT_STORAGE: store,
    MavCmd.PREFLIGHT_CALIBRATION: calibrate,
}
