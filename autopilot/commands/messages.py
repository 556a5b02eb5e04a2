"""Commands that ask for messages: once, or at an interval."""

from autopilot.commands.types import CommandResult, Desk, Handler, MavCommand, integer_parameter
from autopilot.comms.stream_rates import Schedule
from autopilot.control import modes
from autopilot.control.types import ACCEPTED, DENIED, UNSUPPORTED, US_PER_S
from autopilot.telemetry import identity
from mavlink_io import dialect
from mavlink_io.dialect import MessageType
from mavlink_io.mission_items import MavCmd

HEARTBEAT_US = US_PER_S
_HEARTBEAT, _INTERVAL = dialect.by_name("HEARTBEAT"), dialect.by_name("MESSAGE_INTERVAL")
_ALL_MODES = 0
_DEFAULT, _OFF, _NOT_AVAILABLE = 0, -1, 0
"""SET_MESSAGE_INTERVAL's marks, and that of MESSAGE_INTERVAL for a message that is never
streamed."""


def set_interval(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    number, interval = integer_parameter(command.p1), integer_parameter(command.p2)
    if number == _HEARTBEAT.message_id:
        if interval in (_DEFAULT, HEARTBEAT_US):
            return CommandResult(ACCEPTED)
        return desk.refuse(DENIED, "HEARTBEAT stays at 1 Hz: clients take its absence for a loss")
    try:
        schedule.set_interval(number, None if interval == _DEFAULT else max(0, interval))
    except KeyError:
        return CommandResult(UNSUPPORTED)
    return CommandResult(ACCEPTED)


def get_interval(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    number = integer_parameter(command.p1)
    if number == _HEARTBEAT.message_id:
        return CommandResult(ACCEPTED, ((_INTERVAL, (HEARTBEAT_US, number)),))
    try:
        interval = schedule.interval_us(number) or _OFF
    except KeyError:
        return CommandResult(UNSUPPORTED, ((_INTERVAL, (_NOT_AVAILABLE, number & 0xFFFF)),))
    return CommandResult(ACCEPTED, ((_INTERVAL, (interval, number)),))


def request_message(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    message = dialect.by_id(integer_parameter(command.p1))
    if message is None:
        return CommandResult(UNSUPPORTED)
    if message.name == "AVAILABLE_MODES":
        return request_modes(desk, message, integer_parameter(command.p2))
    return _send_message(message, desk)


def request_modes(desk: Desk, message: MessageType, index: int) -> CommandResult:
    wanted = range(1, len(modes.MODES) + 1) if index == _ALL_MODES else (index,)
    try:
        return CommandResult(ACCEPTED, tuple((message, identity.available_mode(n)) for n in wanted))
    except IndexError:
        return desk.refuse(
            DENIED, f"AVAILABLE_MODES: param2 is {index}, must be 0 to {len(modes.MODES)}"
        )


def request_version(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    return _send_message(dialect.by_name("AUTOPILOT_VERSION"), desk)


def request_home(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    return _send_message(dialect.by_name("HOME_POSITION"), desk)


def _send_message(message: MessageType, desk: Desk) -> CommandResult:
    built = tuple((message, values) for values in desk.build(message))
    return CommandResult(ACCEPTED if built else UNSUPPORTED, built)


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.SET_MESSAGE_INTERVAL: set_interval,
    MavCmd.GET_MESSAGE_INTERVAL: get_interval,
    MavCmd.REQUEST_MESSAGE: request_message,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: request_version,
    MavCmd.GET_HOME_POSITION: request_home,
}
