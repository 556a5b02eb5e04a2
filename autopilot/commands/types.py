"""A MAV_CMD as it came, and what became of it."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.comms.stream_rates import Schedule
from autopilot.control.manual_control import Helm
from autopilot.control.types import ACCEPTED, Severity
from autopilot.vehicle import Vehicle
from mavlink_io.dialect import MessageType, Values
from mavlink_io.mission_items import NOT_GIVEN

_INT32_LIMIT = 1 << 31
LOWEST_CUSTOM_MODE = 65_536
"""DO_SET_MODE.param2 from here on is a whole custom_mode, below it is PX4's main mode."""


class MavCommand(NamedTuple):
    """A command as it came. Parameters may be NaN: not given."""

    number: int
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    p6: float
    p7: float
    scaled: bool
    """COMMAND_INT: p5 and p6 are whole numbers, 1e-7 degrees where they are a place."""
    repetition: bool = False
    """COMMAND_LONG: its sender says that it was sent before."""


class JobProgress(NamedTuple):
    """How far a long job is: IN_PROGRESS with its share done, or the MAV_RESULT that ends it."""

    result: int
    percent: int = 0


Job = Callable[[], JobProgress]
"""Tells how far a long job is whenever it is asked."""


class CommandResult(NamedTuple):
    """MAV_RESULT, the messages to send to the requester after the acknowledgement, and a job that
    goes on."""

    result: int
    messages: tuple[tuple[MessageType, Values], ...] = ()
    job: Job | None = None


class CommandContext(NamedTuple):
    """All that the handlers of commands may use."""

    vehicle: Vehicle
    helm: Helm
    build: Callable[[MessageType], tuple[Values, ...]]
    """The fields of any message that can be asked for, several times where it takes several; empty
    for others."""
    tell_parameter: Callable[[str], None]
    """Tell every link what a parameter is now."""

    def ask(self, wish: Any) -> CommandResult:
        """Ask the vehicle, which says aloud why it refuses."""
        return CommandResult(self.vehicle.handle_request(wish).result)

    def refuse(self, result: int, text: str) -> CommandResult:
        self.vehicle.send_statustext(text)
        return CommandResult(result)

    def accept_with_notice(self, text: str) -> CommandResult:
        """Accept, and say what came of it."""
        self.vehicle.send_statustext(text, Severity.NOTICE)
        return CommandResult(ACCEPTED)


Handler = Callable[[CommandContext, MavCommand, Schedule], CommandResult]
"""Carries a command out; the schedule is that of the link it came by."""


def command_from_message(message: Any) -> MavCommand:
    """The command in a decoded COMMAND_LONG or COMMAND_INT."""
    m = message
    if not hasattr(m, "x"):
        given = m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7
        return MavCommand(m.command, *given, scaled=False, repetition=m.confirmation > 0)
    x, y = (math.nan if n == NOT_GIVEN else n for n in (m.x, m.y))
    return MavCommand(m.command, m.param1, m.param2, m.param3, m.param4, x, y, m.z, scaled=True)


def custom_mode(command: MavCommand) -> int | None:
    """Return the custom_mode of a DO_SET_MODE, None where its number is another autopilot's.

    A main mode without a sub mode looks like a small number of ArduPilot, whose AUTO (3) would be
    STATION here. Their senders differ in what fills the parameters that are not used: MAVSDK, which
    means main and sub mode, sends NaN; pymavlink and MAVProxy, which mean ArduPilot's numbers
    unless they know this vehicle's whole ones, send 0."""
    main, sub = integer_parameter(command.p2), integer_parameter(command.p3)
    if main >= LOWEST_CUSTOM_MODE:
        return main
    unused = command.p4, command.p5, command.p6, command.p7
    if sub == 0 and not all(map(math.isnan, unused)):
        return None
    return main << 16 | sub << 24


def unknown_mode_text(number: int) -> str:
    """Return why a mode number of another autopilot is refused, for a person."""
    return (
        f"Mode {number} refused: not a number of this vehicle's (AVAILABLE_MODES); "
        "MAVProxy needs `ground modes install`"
    )


def integer_parameter(value: float, default: int = 0) -> int:
    """The value as a whole number, ``default`` where none was given or no int32 holds it."""
    return int(value) if abs(value) < _INT32_LIMIT else default
