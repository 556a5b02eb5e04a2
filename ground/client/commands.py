"""Requests of the MAVLink command protocol: a command with acknowledgement, and the mode list.

Sources: https://mavlink.io/en/services/command.html and
https://mavlink.io/en/services/standard_modes.html.
"""

from typing import Any

from mavlink_io.dialect import constant, enum_names
from mavlink_io.mission_items import MavCmd
from mavlink_io.request import Exchange, MavlinkId, Send

ACCEPTED, IN_PROGRESS = constant("MAV_RESULT_ACCEPTED"), constant("MAV_RESULT_IN_PROGRESS")
TEMPORARILY_REJECTED = constant("MAV_RESULT_TEMPORARILY_REJECTED")

_MISSING_NAMES = {("MAV_RESULT", 6): "MAV_RESULT_CANCELLED"}
"""Entries of enums that pymavlink lacks."""
_STANDARD_NAMES = {
    constant("MAV_STANDARD_MODE_SAFE_RECOVERY"): "RTL",
    constant("MAV_STANDARD_MODE_MISSION"): "MISSION",
    constant("MAV_STANDARD_MODE_LAND"): "SURFACE",
}
"""Names of standard modes, used if the vehicle sends no name for them."""
MAX_SAME_PROGRESS_S = 600.0
"""Wall time in which a command in progress may report the same progress; it is in whole percent."""


class CommandExchange(Exchange[None]):
    """A COMMAND_LONG; done when the vehicle reports that it has accepted and finished it."""

    message_names = frozenset(("COMMAND_ACK",))
    max_repeats_s = MAX_SAME_PROGRESS_S

    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, command: int, *parameters: float
    ) -> None:
        super().__init__(send, own, peer)
        self._command = command
        self._parameters = (*parameters, *(0.0,) * (7 - len(parameters)))
        self._confirmation, self._progress = 0, -1
        self.refusal: int | None = None
        """MAV_RESULT of a refusal; None without one."""

    def _send_request(self) -> None:
        """Send the command; the confirmation counts its repetitions."""
        fields = {f"param{n}": value for n, value in enumerate(self._parameters, start=1)}
        self._send_to_peer(
            "COMMAND_LONG", command=self._command, confirmation=self._confirmation, **fields
        )
        self._confirmation = min(255, self._confirmation + 1)

    def _handle_message(self, name: str, message: Any) -> None:
        """Finish or fail with the result of the COMMAND_ACK of this command."""
        if message.command != self._command:
            return
        if message.result == IN_PROGRESS:
            self._note_progress(is_new=message.progress > self._progress)
            self._progress = max(self._progress, message.progress)
        elif message.result == ACCEPTED:
            self._finish(None)
        else:
            self.refusal = message.result
            self._fail(f"{self._describe()}: {readable_name(message.result, 'MAV_RESULT')}")

    def _describe(self) -> str:
        return readable_name(self._command, "MAV_CMD")


class ModeList(Exchange[dict[str, int]]):
    """Request for AVAILABLE_MODES; the result is `custom_mode` by mode name."""

    message_names = frozenset(("AVAILABLE_MODES",))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        super().__init__(send, own, peer)
        self._modes: dict[int, tuple[str, int]] = {}
        self._missing: set[int] | None = None

    def _send_request(self) -> None:
        """Request all modes, or those that are missing."""
        for index in (0,) if self._missing is None else sorted(self._missing):
            fields = {f"param{n}": 0.0 for n in range(3, 8)}
            number = constant("MAVLINK_MSG_ID_AVAILABLE_MODES")
            self._send_to_peer(
                "COMMAND_LONG",
                command=MavCmd.REQUEST_MESSAGE,
                confirmation=0,
                param1=number,
                param2=index,
                **fields,
            )

    def _handle_message(self, name: str, message: Any) -> None:
        """Store the name and number of a mode; finish when none is missing."""
        is_new = message.mode_index not in self._modes
        self._modes[message.mode_index] = listed_mode_name(message), message.custom_mode
        self._missing = set(range(1, message.number_modes + 1)) - set(self._modes)
        self._note_progress(is_new=is_new)
        if not self._missing:
            self._finish(dict(self._modes[index] for index in sorted(self._modes)))

    def _describe(self) -> str:
        return "the list of modes"


def listed_mode_name(message: Any) -> str:
    """Return the name of the mode in an AVAILABLE_MODES.

    Parameters
    ----------
    message : namedtuple
        Decoded message; a standard mode may come without a name.

    Returns
    -------
    str
        Name as shown to the user.
    """
    return message.mode_name or _STANDARD_NAMES.get(
        message.standard_mode, f"MODE_{message.custom_mode}"
    )


def readable_name(value: int, enum: str) -> str:
    """Return the name of an enum entry without prefix, in lower case with spaces."""
    return (
        enum_names(enum)
        .get(value, _MISSING_NAMES.get((enum, value), f"{enum}_{value}"))
        .removeprefix(f"{enum}_")
        .replace("_", " ")
        .lower()
    )
