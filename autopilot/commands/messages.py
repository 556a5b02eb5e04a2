"""Commands that request messages, once or at an interval."""

from autopilot.commands.types import (
    CommandContext,
    CommandResult,
    Handler,
    MavCommand,
    integer_parameter,
)
from autopilot.comms.stream_rates import Schedule
from autopilot.control.types import ACCEPTED, DENIED, UNSUPPORTED, US_PER_S
from autopilot.telemetry import identity
from mavlink_io import dialect
from mavlink_io.dialect import MessageType
from mavlink_io.mission_items import MavCmd

HEARTBEAT_US = US_PER_S
_HEARTBEAT, _INTERVAL = dialect.by_name("HEARTBEAT"), dialect.by_name("MESSAGE_INTERVAL")
_ALL_MODES = 0
"""Index that requests all AVAILABLE_MODES messages."""
_DEFAULT, _OFF, _NOT_AVAILABLE = 0, -1, 0
"""Special intervals: default, stopped, and (in MESSAGE_INTERVAL) not available."""


def set_interval(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """SET_MESSAGE_INTERVAL on the link of the command: interval in us."""
    number, interval = integer_parameter(command.p1), integer_parameter(command.p2)
    if number == _HEARTBEAT.message_id:
        if interval in (_DEFAULT, HEARTBEAT_US):
            return CommandResult(ACCEPTED)
        return context.refuse(
            DENIED, "HEARTBEAT stays at 1 Hz: without it clients report a lost link"
        )
    if schedule.answers_only:
        return context.refuse(
            DENIED, "No message intervals on a high-latency link: REQUEST_MESSAGE sends one"
        )
    try:
        schedule.set_interval(number, None if interval == _DEFAULT else max(0, interval))
    except KeyError:
        return CommandResult(UNSUPPORTED)
    return CommandResult(ACCEPTED)


def control_high_latency(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """CONTROL_HIGH_LATENCY on the link of the command: HIGH_LATENCY2 (1), or not (0)."""
    if command.p1 not in (0, 1):
        return context.refuse(
            DENIED, f"CONTROL_HIGH_LATENCY: param1 is {command.p1:g}, must be 0 or 1"
        )
    schedule.control_high_latency(command.p1 == 1)
    return CommandResult(ACCEPTED)


def get_interval(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """GET_MESSAGE_INTERVAL: reply with MESSAGE_INTERVAL."""
    number = integer_parameter(command.p1)
    if number == _HEARTBEAT.message_id:
        return CommandResult(ACCEPTED, ((_INTERVAL, (HEARTBEAT_US, number)),))
    try:
        interval = schedule.interval_us(number) or _OFF
    except KeyError:
        return CommandResult(UNSUPPORTED, ((_INTERVAL, (_NOT_AVAILABLE, number & 0xFFFF)),))
    return CommandResult(ACCEPTED, ((_INTERVAL, (interval, number)),))


def request_message(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """REQUEST_MESSAGE: send a message once; param2 selects a mode, or an interval's message."""
    message = dialect.by_id(integer_parameter(command.p1))
    if message is None:
        return CommandResult(UNSUPPORTED)
    if message.name == "AVAILABLE_MODES":
        return request_modes(context, message, integer_parameter(command.p2))
    if message is _INTERVAL:
        return get_interval(context, command._replace(p1=command.p2), schedule)
    return _send_message(message, context)


def request_modes(context: CommandContext, message: MessageType, index: int) -> CommandResult:
    """Return AVAILABLE_MODES of one mode, or of all modes for index 0."""
    table = context.mode_table
    indexes = range(1, len(table.listed) + 1) if index == _ALL_MODES else (index,)
    try:
        return CommandResult(
            ACCEPTED, tuple((message, identity.available_mode(n, table)) for n in indexes)
        )
    except IndexError:
        return context.refuse(
            DENIED, f"AVAILABLE_MODES: param2 is {index}, must be 0 to {len(table.listed)}"
        )


def request_version(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """REQUEST_AUTOPILOT_CAPABILITIES: send AUTOPILOT_VERSION."""
    return _send_message(dialect.by_name("AUTOPILOT_VERSION"), context)


def request_home(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """GET_HOME_POSITION: send HOME_POSITION."""
    return _send_message(dialect.by_name("HOME_POSITION"), context)


def _send_message(message: MessageType, context: CommandContext) -> CommandResult:
    """Return a result with the message; UNSUPPORTED when it cannot be requested."""
    built = tuple((message, values) for values in context.build(message))
    return CommandResult(ACCEPTED if built else UNSUPPORTED, built)


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.SET_MESSAGE_INTERVAL: set_interval,
    MavCmd.GET_MESSAGE_INTERVAL: get_interval,
    MavCmd.REQUEST_MESSAGE: request_message,
    MavCmd.CONTROL_HIGH_LATENCY: control_high_latency,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: request_version,
    MavCmd.GET_HOME_POSITION: request_home,
}
