"""Allow-list of the systems whose messages may change what the vehicle does."""

from collections.abc import Collection

from autopilot.onboard_log.channels import LOGGED_FROM_GROUND
from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.mission_items import MavCmd

READ_ONLY_COMMANDS = frozenset(
    (
        MavCmd.GET_HOME_POSITION,
        MavCmd.GET_MESSAGE_INTERVAL,
        MavCmd.REQUEST_MESSAGE,
        MavCmd.REQUEST_AUTOPILOT_CAPABILITIES,
    )
)
"""Commands that every system may send: they only read."""
MAX_REPORTED = 16
"""Number of refused systems that are reported."""

COMMANDS = frozenset(dialect.by_name(name).message_id for name in ("COMMAND_LONG", "COMMAND_INT"))
_RESTRICTED = LOGGED_FROM_GROUND | {
    dialect.by_name(name).message_id
    for name in ("HEARTBEAT", "SETUP_SIGNING", "LOG_ERASE", "MISSION_ACK")
}
"""Messages that change behaviour, keep a failsafe from acting, or erase data."""


class AllowListError(InputError):
    """The list of commanding systems is not valid."""

    code = ErrorCode.ALLOW_LIST


class Commanders:
    """Systems that may command; an empty list lets every system command."""

    def __init__(self, systems: Collection[int] = ()) -> None:
        self._systems = frozenset(systems)
        self._reported: set[int] = set()

    def accepts(self, frame: Frame) -> bool:
        """Return whether a message of its sender is served."""
        if not self._systems or frame.system in self._systems:
            return True
        if frame.message_id in COMMANDS:
            return frame.decode().command in READ_ONLY_COMMANDS
        return frame.message_id not in _RESTRICTED

    def report(self, frame: Frame) -> str:
        """Return a text for the first refused message of a system, "" for the next ones."""
        if frame.name == "HEARTBEAT" or frame.system in self._reported:
            return ""
        if len(self._reported) >= MAX_REPORTED:
            return ""
        self._reported.add(frame.system)
        return f"System {frame.system} may not command: {frame.name} refused"


def systems_of(text: str) -> frozenset[int]:
    """Return the system ids in a list such as ``255,250``.

    Raises AllowListError.
    """
    words = [word.strip() for word in text.split(",")]
    for word in words:
        if not (word.isdecimal() and len(word) <= 3 and 1 <= int(word) <= 255):
            raise AllowListError(
                f"--accept {text!r}: {word!r} is no system id; give numbers from 1 to 255"
            )
    return frozenset(map(int, words))
