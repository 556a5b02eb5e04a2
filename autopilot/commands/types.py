"""Types of the command protocol: received command, result, progress and handler context."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.comms.stream_rates import Schedule
from autopilot.control.manual_control import Helm
from autopilot.control.types import ACCEPTED, Severity
from autopilot.telemetry.identity import ModeTable
from autopilot.vehicle import Vehicle
from mavlink_io.dialect import MessageType, Values
from mavlink_io.mission_items import NOT_GIVEN

_INT32_LIMIT = 1 << 31
LOWEST_CUSTOM_MODE = 65_536
"""Lowest DO_SET_MODE.param2 that is a complete custom_mode; below it is PX4's main mode."""


class MavCommand(NamedTuple):
    """A received command. A parameter that is not given may be NaN."""

    number: int
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    p6: float
    p7: float
    scaled: bool
    """Whether it is a COMMAND_INT, with a position in p5 and p6 in 1e-7 degrees."""
    repetition: bool = False
    """Whether the sender of a COMMAND_LONG marks it as a repetition."""
    frame: int = 0
    """MAV_FRAME of a COMMAND_INT; GLOBAL for a COMMAND_LONG, whose position is in degrees."""


class JobProgress(NamedTuple):
    """Progress of a long job: IN_PROGRESS with a percentage, or its final MAV_RESULT."""

    result: int
    percent: int = 0


Job = Callable[[], JobProgress]
"""Function that returns the present progress of a long job."""


class CommandResult(NamedTuple):
    """Result of a command: MAV_RESULT, messages for the requester, and a long job if started."""

    result: int
    messages: tuple[tuple[MessageType, Values], ...] = ()
    job: Job | None = None


class CommandContext(NamedTuple):
    """Context of the command handlers: everything that they may use."""

    vehicle: Vehicle
    helm: Helm
    build: Callable[[MessageType], tuple[Values, ...]]
    """Return the fields of each message of a type; empty when it cannot be requested."""
    publish_parameter: Callable[[str], None]
    """Send the present value of a parameter to every link."""
    mode_table: ModeTable
    """Numbers of the modes in messages."""

    def ask(self, request: Any) -> CommandResult:
        """Pass a request to the vehicle, which sends the reason of a refusal."""
        return CommandResult(self.vehicle.handle_request(request).result)

    def refuse(self, result: int, text: str) -> CommandResult:
        """Refuse the command and send the reason."""
        self.vehicle.send_statustext(text)
        return CommandResult(result)

    def accept_with_notice(self, text: str) -> CommandResult:
        """Accept the command and send a notice."""
        self.vehicle.send_statustext(text, Severity.NOTICE)
        return CommandResult(ACCEPTED)


Handler = Callable[[CommandContext, MavCommand, Schedule], CommandResult]
"""Function that executes a command; the schedule is that of the link of the command."""


def command_from_message(message: Any) -> MavCommand:
    """Return the command in a decoded COMMAND_LONG or COMMAND_INT."""
    m = message
    if not hasattr(m, "x"):
        parameters = m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7
        return MavCommand(m.command, *parameters, scaled=False, repetition=m.confirmation > 0)
    x, y = (math.nan if n == NOT_GIVEN else n for n in (m.x, m.y))
    return MavCommand(
        number=m.command,
        p1=m.param1,
        p2=m.param2,
        p3=m.param3,
        p4=m.param4,
        p5=x,
        p6=y,
        p7=m.z,
        scaled=True,
        frame=m.frame,
    )


def custom_mode(command: MavCommand, table: ModeTable) -> int | None:
    """Return the custom_mode of a DO_SET_MODE; None for a number of another autopilot.

    With PX4's numbers a main mode without a sub mode looks like a mode number of ArduPilot, whose
    AUTO (3) would be STATION here. The unused parameters distinguish them: MAVSDK, which sends main
    and sub mode, fills them with NaN; pymavlink and MAVProxy, which send ArduPilot's numbers unless
    they know the modes of this vehicle, fill them with 0.
    """
    main, sub = integer_parameter(command.p2), integer_parameter(command.p3)
    if not table.has_sub_modes or main >= LOWEST_CUSTOM_MODE:
        return main
    unused = command.p4, command.p5, command.p6, command.p7
    if sub == 0 and not all(map(math.isnan, unused)):
        return None
    return main << 16 | sub << 24


def unknown_mode_text(number: int) -> str:
    """Return the text that refuses a mode number of another autopilot."""
    return (
        f"Mode {number} refused: not a mode of this vehicle (AVAILABLE_MODES); "
        "MAVProxy needs `ground modes export-mavproxy`"
    )


def integer_parameter(value: float, default: int = 0) -> int:
    """Return the value as an integer; ``default`` for NaN or a value outside int32."""
    return int(value) if abs(value) < _INT32_LIMIT else default
