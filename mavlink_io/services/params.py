"""The MAVLink parameter protocol: both ends of it (https://mavlink.io/en/services/parameter.html).

Every parameter travels as MAV_PARAM_TYPE_REAL32, integers as floats of exact integer value, so that
clients which convert and clients which copy bytes read the same number."""

import math
import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

from mavlink_io.codec import Frame, largest_frame
from mavlink_io.dialect import by_name, constant
from mavlink_io.request import Client, Exchange, MavlinkId, RoomBytes, Send

REAL32 = constant("MAV_PARAM_TYPE_REAL32")
DOES_NOT_EXIST = constant("MAV_PARAM_ERROR_DOES_NOT_EXIST")
OUT_OF_RANGE = constant("MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE")
_INTEGERS = range(constant("MAV_PARAM_TYPE_UINT8"), REAL32)

NO_INDEX = 65_535
"""param_index of a value that is sent by name."""
MAX_RE_REQUESTS = 20
"""How many missing parameters a client asks for in one go."""
MAX_VALUES_PER_POLL = 16
"""How many values of a list a server sends in one go where the link takes more."""
_MAX_FRAME_BYTES = largest_frame(by_name("PARAM_VALUE"))

_REASONS = {
    DOES_NOT_EXIST: "there is no such parameter",
    OUT_OF_RANGE: "the value is out of range",
    constant("MAV_PARAM_ERROR_READ_ONLY"): "it cannot be changed",
}


def as_real32(value: float) -> float:
    """The number that a float32 field makes of ``value``. Raises OverflowError beyond float32's
    range."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


class ParamProvider(Protocol):
    """The parameters of a vehicle."""

    def names(self) -> Sequence[str]:
        """Sorted, the same ones in the same order for as long as the vehicle runs."""
        ...

    def get(self, name: str) -> float: ...

    def set(self, name: str, value: float) -> float:
        """Store a value and return what was really stored. Raises ValueError, and says what would
        be right."""
        ...


class ParamClient:
    """The ground's side: each method begins an exchange, to be fed and polled until it is done."""

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        self._line = send, own, peer

    def list(self) -> Exchange[dict[str, float]]:
        """Every parameter by name; those that were lost on the way are asked for again by index."""
        return _ParamList(*self._line)

    def get(self, name: str) -> Exchange[float]:
        """One parameter."""
        return _Get(*self._line, name)

    def set(self, name: str, value: float) -> Exchange[float]:
        """Set one parameter; done when the vehicle has read it back. Raises ValueError for NaN and
        infinity."""
        return _Set(*self._line, name, value)


class _ParamList(Exchange[dict[str, float]]):
    message_names = frozenset(("PARAM_VALUE",))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        super().__init__(send, own, peer)
        self._values: dict[str, float] = {}
        self._missing: set[int] | None = None

    def _send_request(self) -> None:
        if self._missing is None:
            self._send_to_peer("PARAM_REQUEST_LIST")
        for index in sorted(self._missing or ())[:MAX_RE_REQUESTS]:
            self._send_to_peer("PARAM_REQUEST_READ", param_id="", param_index=index)

    def _handle_message(self, name: str, message: Any) -> None:
        self._values[message.param_id] = message.param_value
        if message.param_index == NO_INDEX:
            return
        if self._missing is None:
            self._missing = set(range(message.param_count))
        self._missing.discard(message.param_index)
        self._note_progress()
        if not self._missing:
            self._finish(dict(sorted(self._values.items())))

    def _describe(self) -> str:
        return "the parameter list"


class _Get(Exchange[float]):
    message_names = frozenset(("PARAM_VALUE", "PARAM_ERROR"))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId, name: str) -> None:
        super().__init__(send, own, peer)
        self._name = name

    def _send_request(self) -> None:
        self._send_to_peer("PARAM_REQUEST_READ", param_id=self._name, param_index=-1)

    def _handle_message(self, name: str, message: Any) -> None:
        if message.param_id != self._name:
            return
        if name == "PARAM_ERROR":
            self._fail(
                f"parameter {self._name}: {_REASONS.get(message.error, f'error {message.error}')}"
            )
        else:
            self._take(message.param_value)

    def _take(self, value: float) -> None:
        self._finish(value)

    def _describe(self) -> str:
        return f"the request for parameter {self._name}"


class _Set(_Get):
    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, name: str, value: float
    ) -> None:
        super().__init__(send, own, peer, name)
        if not math.isfinite(value):
            raise ValueError(f"parameter {name}: {value} is no finite number")
        self._value = as_real32(value)

    def _send_request(self) -> None:
        self._send_to_peer(
            "PARAM_SET", param_id=self._name, param_value=self._value, param_type=REAL32
        )

    def _take(self, value: float) -> None:
        if value == self._value:
            self._finish(value)
        else:
            self._fail(
                f"parameter {self._name}: the vehicle keeps {value:g} and not {self._value:g}"
            )

    def _describe(self) -> str:
        return f"the setting of parameter {self._name}"


class _Listing(NamedTuple):
    """A list being sent: how much its link takes, and from where it goes on."""

    room: RoomBytes
    position: int


class ParamServer:
    """The vehicle's side. A changed value is told to every link, so that no client shows an old
    one."""

    message_names = frozenset(("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"))

    def __init__(
        self, table: ParamProvider, broadcast: Send, explain: Callable[[str], None]
    ) -> None:
        self._table, self._broadcast, self._explain = table, broadcast, explain
        self._names = tuple(table.names())
        self._listings: dict[Client, _Listing] = {}

    def feed(self, frame: Frame, send: Send, room: RoomBytes) -> None:
        """Serve one frame that is addressed to this vehicle; ``send`` and ``room`` are of the link
        it came by."""
        sender = MavlinkId(frame.system, frame.component)
        message = frame.decode()
        match frame.name:
            case "PARAM_REQUEST_LIST":
                self._listings[Client(sender, send)] = _Listing(room, 0)
            case "PARAM_REQUEST_READ":
                self._read(message, sender, send)
            case "PARAM_SET":
                self._set(message, sender, send)

    def tell(self, name: str) -> None:
        """Tell every link what a parameter is now: it was not a PARAM_SET that changed it."""
        self._value(self._broadcast, name, self._names.index(name))

    def poll(self) -> None:
        """Send the next part of every list that was asked for, as far as its link has room."""
        for client, (room, start) in list(self._listings.items()):
            position = start
            while (
                position < min(start + MAX_VALUES_PER_POLL, len(self._names))
                and room() >= _MAX_FRAME_BYTES
            ):
                self._value(client.send, self._names[position], position)
                position += 1
            if position < len(self._names):
                self._listings[client] = _Listing(room, position)
            else:
                del self._listings[client]

    def _read(self, message: Any, sender: MavlinkId, send: Send) -> None:
        by_index = message.param_index >= 0
        if by_index and message.param_index < len(self._names):
            self._value(send, self._names[message.param_index], message.param_index)
        elif not by_index and message.param_id in self._names:
            self._value(send, message.param_id, self._names.index(message.param_id))
        else:
            _error(send, sender, message.param_id, message.param_index, DOES_NOT_EXIST)

    def _set(self, message: Any, sender: MavlinkId, send: Send) -> None:
        name = message.param_id
        if name not in self._names:
            self._explain(f"Parameter {name}: there is none of this name")
            _error(send, sender, name, -1, DOES_NOT_EXIST)
            return
        try:
            self._table.set(name, _value_of(message))
        except ValueError as refusal:
            self._explain(str(refusal))
            _error(send, sender, name, -1, OUT_OF_RANGE)
            self._value(send, name, self._names.index(name))
        else:
            self.tell(name)

    def _value(self, send: Send, name: str, index: int) -> None:
        send(
            "PARAM_VALUE",
            param_id=name,
            param_value=self._table.get(name),
            param_type=REAL32,
            param_count=len(self._names),
            param_index=index,
        )


def _value_of(message: Any) -> float:
    """The value in a PARAM_SET. An integer type leaves open whether the bytes or the number are
    meant: refused."""
    if message.param_type in _INTEGERS:
        raise ValueError(f"Parameter {message.param_id}: to be sent as REAL32, not as an integer")
    if not math.isfinite(message.param_value):
        raise ValueError(f"Parameter {message.param_id}: {message.param_value} is not finite")
    return float(message.param_value)


def _error(send: Send, receiver: MavlinkId, name: str, index: int, error: int) -> None:
    send(
        "PARAM_ERROR",
        target_system=receiver.system,
        target_component=receiver.component,
        param_id=name,
        param_index=index,
        error=error,
    )
