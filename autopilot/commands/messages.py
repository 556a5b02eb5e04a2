"""Commands that ask for messages: once, or at an interval."""

from autopilot.commands.types import Command, Desk, Handler, Outcome, whole
from autopilot.comms.stream_rates import Schedule
from autopilot.control import modes
from autopilot.control.types import ACCEPTED, DENIED, UNSUPPORTED, US_PER_S
from autopilot.telemetry import identity
from mavlink_io import dialect
from mavlink_io.dialect import MessageType

HEARTBEAT_US = US_PER_S
_HEARTBEAT, _INTERVAL = dialect.by_name("HEARTBEAT"), dialect.by_name("MESSAGE_INTERVAL")
_ALL_MODES = 0
_DEFAULT, _OFF, _NOT_AVAILABLE = 0, -1, 0
"""SET_MESSAGE_INTERVAL's marks, and that of MESSAGE_INTERVAL for a message that is never
streamed."""


def set_interval(desk: Desk, command: Command, schedule: Schedule) -> Outcome:
    number, interval = whole(command.p1), whole(command.p2)
    if number == _HEARTBEAT.message_id:
        if interval in (_DEFAULT, HEARTBEAT_US):
            return Outcome(ACCEPTED)
        return desk.refuse(DENIED, "HEARTBEAT stays at 1 Hz: clients take its absence for a loss")
    try:
        schedule.set_interval(number, None if interval == _DEFAULT else max(0, interval))
    except KeyError:
        return Outcome(UNSUPPORTED)
    return Outcome(ACCEPTED)


def get_interval(desk: Desk, command: Command, schedule: Schedule) -> Outcome:
    number = whole(command.p1)
    if number == _HEARTBEAT.message_id:
        return Outcome(ACCEPTED, ((_INTERVAL, (HEARTBEAT_US, number)),))
    try:
        interval = schedule.interval_us(number) or _OFF
    except KeyError:
        return Outcome(UNSUPPORTED, ((_INTERVAL, (_NOT_AVAILABLE, number & 0xFFFF)),))
    return Outcome(ACCEPTED, ((_INTERVAL, (interval, number)),))


def give_message(desk: Desk, command: Command, schedule: Schedule) -> Outcome:
    message = dialect.by_id(whole(command.p1))
    if message is None:
        return Outcome(UNSUPPORTED)
    if message.name == "AVAILABLE_MODES":
        return give_modes(desk, message, whole(command.p2))
    return _give(message, desk)


def give_modes(desk: Desk, message: MessageType, index: int) -> Outcome:
    wanted = range(1, len(modes.MODES) + 1) if index == _ALL_MODES else (index,)
    try:
        return Outcome(ACCEPTED, tuple((message, identity.available_mode(n)) for n in wanted))
    except IndexError:
        return desk.refuse(
            DENIED, f"AVAILABLE_MODES: param2 is {index}, must be 0 to {len(modes.MODES)}"
        )


def give_version(desk: Desk, command: Command, schedule: Schedule) -> Outcome:
    return _give(dialect.by_name("AUTOPILOT_VERSION"), desk)


def give_home(desk: Desk, command: Command, schedule: Schedule) -> Outcome:
    return _give(dialect.by_name("HOME_POSITION"), desk)


def _give(message: MessageType, desk: Desk) -> Outcome:
    built = tuple((message, values) for values in desk.build(message))
    return Outcome(ACCEPTED if built else UNSUPPORTED, built)


HANDLERS: dict[str, Handler] = {
    "SET_MESSAGE_INTERVAL": set_interval,
    "GET_MESSAGE_INTERVAL": get_interval,
    "REQUEST_MESSAGE": give_message,
    "REQUEST_AUTOPILOT_CAPABILITIES": give_version,
    "GET_HOME_POSITION": give_home,
}
