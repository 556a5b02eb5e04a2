"""Client and server of the MAVLink parameter protocol.

Source: https://mavlink.io/en/services/parameter.html.

The server sends every parameter as MAV_PARAM_TYPE_REAL32; an integer is a float with the integer's
value. Clients that convert numbers and clients that copy bytes then read the same number. The
client also reads and sets the integers of PX4, whose bytes are in the field param_value.
"""

import math
import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame, largest_frame
from mavlink_io.dialect import by_name, constant
from mavlink_io.frame_order import MAX_LATE_S, FrameCounter, FrameOrders
from mavlink_io.param_bytes import INTEGER_FORMATS, decode_bytewise
from mavlink_io.real32 import as_real32
from mavlink_io.request import Client, Exchange, MavlinkId, RoomBytes, Send

T = TypeVar("T")

REAL32 = constant("MAV_PARAM_TYPE_REAL32")
DOES_NOT_EXIST = constant("MAV_PARAM_ERROR_DOES_NOT_EXIST")
OUT_OF_RANGE = constant("MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE")
_INTEGERS = range(constant("MAV_PARAM_TYPE_UINT8"), REAL32)
_REAL32 = struct.Struct("<f")

MAX_NAME_BYTES = 16
"""Length of param_id."""
NO_INDEX = 65_535
"""param_index of a PARAM_VALUE that was requested by name."""
MAX_RE_REQUESTS = 20
"""Maximum number of missing parameters that a client requests at once."""
MAX_REFUSALS = 3
"""Number of requests to set a parameter after which another value means that it is refused."""
MAX_VALUES_PER_POLL = 16
"""Maximum number of values of a list that a server sends per poll and client."""
_MAX_FRAME_BYTES = largest_frame(by_name("PARAM_VALUE"))

_REASONS = {
    DOES_NOT_EXIST: "there is no such parameter",
    OUT_OF_RANGE: "the value is out of range",
    constant("MAV_PARAM_ERROR_READ_ONLY"): "it cannot be changed",
}


class ParamProvider(Protocol):
    """The parameters of a vehicle, as the autopilot implements them."""

    def names(self) -> Sequence[str]:
        """Return the sorted names; they do not change while the vehicle runs."""
        ...

    def get(self, name: str) -> float:
        """Return the value of a parameter."""
        ...

    def set(self, name: str, value: float) -> float:
        """Store a value and return the stored one. Raises ValueError with the valid range."""
        ...


class ValueOrder:
    """Order in which a vehicle has sent the values of each parameter.

    A link may deliver the report of an earlier value after that of a newer one, also in the next
    exchange of a client: all exchanges of a client have one order.
    """

    def __init__(self) -> None:
        self._frames = FrameCounter()
        self._newest: dict[str, tuple[int, float]] = {}
        """Position and time of the newest value of each parameter."""

    def is_old(self, frame: Frame, now_s: float) -> bool:
        """Return whether a newer value of the same parameter has come; call it for all frames.

        Parameters
        ----------
        frame : Frame
            A frame of the vehicle.
        now_s : float
            Wall clock, in seconds.

        Returns
        -------
        bool
            False for other messages, and for values that come ``MAX_LATE_S`` after the newest one:
            the vehicle may have started again.
        """
        position = self._frames.position(frame.sequence)
        if frame.name != "PARAM_VALUE":
            return False
        name = frame.decode().param_id
        newest, newest_s = self._newest.get(name, (position, now_s))
        if position < newest and now_s - newest_s < MAX_LATE_S:
            return True
        self._newest[name] = position, now_s
        return False


class ValueCoding:
    """Coding of param_value, and the types that a vehicle has reported.

    Parameters
    ----------
    bytewise : bool
        Whether param_value has the bytes of an integer (PARAM_ENCODE_BYTEWISE).
    """

    def __init__(self, *, bytewise: bool) -> None:
        self._bytewise = bytewise
        self._types: dict[str, int] = {}
        """MAV_PARAM_TYPE of the last PARAM_VALUE by name."""

    def decode(self, frame: Frame) -> float:
        """Return the value of a PARAM_VALUE and note its type.

        Parameters
        ----------
        frame : Frame
            The PARAM_VALUE.

        Returns
        -------
        float
            The value.
        """
        message = frame.decode()
        self._types[message.param_id] = message.param_type
        if not self._bytewise:
            return float(message.param_value)
        return decode_bytewise(frame.payload.ljust(_REAL32.size, b"\0"), message.param_type)

    def is_known(self, name: str) -> bool:
        """Return whether a value can be encoded.

        Parameters
        ----------
        name : str
            Name of the parameter.

        Returns
        -------
        bool
            False if integers are sent as bytes and the type of the parameter is not known yet.
        """
        return not self._bytewise or name in self._types

    def encode(self, name: str, value: float) -> tuple[float, int]:
        """Return param_value and param_type of a PARAM_SET.

        Parameters
        ----------
        name : str
            Name of the parameter.
        value : float
            Finite value.

        Returns
        -------
        tuple of (float, int)
            The fields.

        Raises
        ------
        ValueError
            The value is out of the range of the type. Or the parameter is an integer, and the value
            is not one, or its bytes change in a float.
        """
        code = self._integer_format(name)
        if code is None:
            try:
                return as_real32(value), REAL32
            except OverflowError:
                raise ValueError(f"{value:g} is out of the range of its type") from None
        if value != round(value):
            raise ValueError(f"{value:g} is not a whole number, as its type says")
        try:
            data = struct.pack(code, round(value)).ljust(_REAL32.size, b"\0")
        except struct.error:
            raise ValueError(f"{value:g} is out of the range of its type") from None
        (copied,) = _REAL32.unpack(data)
        if _REAL32.pack(copied) != data:
            raise ValueError(f"{value:g} cannot be sent: its bytes change in a float")
        return copied, self._types[name]

    def _integer_format(self, name: str) -> str | None:
        """Return the format of the bytes of an integer; None for a float or a plain number."""
        return INTEGER_FORMATS.get(self._types.get(name, REAL32)) if self._bytewise else None


class ParamClient:
    """Client of the parameter protocol; each method returns an exchange that has not started.

    Feed and poll the exchange until it is done (``request.run``).

    Parameters
    ----------
    send : Send
        Function that sends a message to the vehicle.
    own, peer : MavlinkId
        Ids of this program and of the vehicle.
    bytewise : bool
        Whether the vehicle sends integers as bytes (PARAM_ENCODE_BYTEWISE), as PX4 does.
    """

    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, *, bytewise: bool = False
    ) -> None:
        self._participants = send, own, peer
        self._order, self._coding = ValueOrder(), ValueCoding(bytewise=bytewise)

    def list(self) -> Exchange[dict[str, float]]:
        """Read every parameter; lost ones are requested again by index.

        Returns
        -------
        Exchange
            Its result is a dict of values by name, sorted by name.
        """
        return _ParamList(*self._participants, self._order, self._coding)

    def get(self, name: str) -> "ParamRequest":
        """Read one parameter.

        Parameters
        ----------
        name : str
            Name of the parameter.

        Returns
        -------
        ParamRequest
            Its result is the value. It fails if the vehicle has no such parameter.
        """
        return ParamRequest(*self._participants, self._order, self._coding, name)

    def set(self, name: str, value: float) -> "ParamRequest":
        """Set one parameter.

        Parameters
        ----------
        name : str
            Name of the parameter.
        value : float
            New value.

        Returns
        -------
        ParamRequest
            Its result is the value that the vehicle has reported back. It fails if the vehicle
            reports another value or an error.

        Raises
        ------
        ValueError
            The value is NaN or infinite.
        """
        return _Set(*self._participants, self._order, self._coding, name, value)


class _OrderedExchange(Exchange[T]):
    """Exchange that ignores an old value of a parameter, and decodes the others."""

    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, order: ValueOrder, coding: ValueCoding
    ) -> None:
        super().__init__(send, own, peer)
        self._values_order, self._coding = order, coding
        self._received = math.nan
        """Value of the last PARAM_VALUE."""

    def _is_late(self, frame: Frame) -> bool:
        if self._values_order.is_old(frame, self._now_s):
            return True
        if frame.name == "PARAM_VALUE":
            self._received = self._coding.decode(frame)
        return False


class _ParamList(_OrderedExchange[dict[str, float]]):
    """Request the list, then the missing parameters by index."""

    message_names = frozenset(("PARAM_VALUE",))

    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, order: ValueOrder, coding: ValueCoding
    ) -> None:
        super().__init__(send, own, peer, order, coding)
        self._values: dict[str, float] = {}
        self._missing: set[int] | None = None

    def _send_request(self) -> None:
        """Request all parameters, or up to MAX_RE_REQUESTS of those that are missing."""
        if self._missing is None:
            self._send_to_peer("PARAM_REQUEST_LIST")
        for index in sorted(self._missing or ())[:MAX_RE_REQUESTS]:
            self._send_to_peer("PARAM_REQUEST_READ", param_id="", param_index=index)

    def _handle_message(self, name: str, message: Any) -> None:
        """Store the value of a PARAM_VALUE; finish when none is missing."""
        self._values[message.param_id] = self._received
        if message.param_index == NO_INDEX:
            return
        if self._missing is None:
            self._missing = set(range(message.param_count))
        self._note_progress(is_new=message.param_index in self._missing)
        self._missing.discard(message.param_index)
        if not self._missing:
            self._finish(dict(sorted(self._values.items())))

    def _describe(self) -> str:
        return "the parameter list"


class ParamRequest(_OrderedExchange[float]):
    """Request for one parameter by name.

    Parameters
    ----------
    send : Send
        Function that sends a message to the vehicle.
    own, peer : MavlinkId
        Ids of this program and of the vehicle.
    order : ValueOrder
        Order of the values, of the client.
    coding : ValueCoding
        Coding of the values, of the client.
    name : str
        Name of the parameter.
    """

    message_names = frozenset(("PARAM_VALUE", "PARAM_ERROR"))

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        order: ValueOrder,
        coding: ValueCoding,
        name: str,
    ) -> None:
        super().__init__(send, own, peer, order, coding)
        self._name = name
        self.does_not_exist = False
        """Whether the vehicle has no such parameter."""
        if len(name.encode()) > MAX_NAME_BYTES:  # the message would hold another name
            self._refuse(DOES_NOT_EXIST)

    def _send_request(self) -> None:
        self._send_to_peer("PARAM_REQUEST_READ", param_id=self._name, param_index=-1)

    def _handle_message(self, name: str, message: Any) -> None:
        """Handle the value of this parameter, or fail with the reason of a PARAM_ERROR."""
        if message.param_id != self._name:
            return
        if name == "PARAM_ERROR":
            self._refuse(message.error)
        else:
            self._handle_value(self._received)

    def _refuse(self, error: int) -> None:
        """Fail with the reason of a MAV_PARAM_ERROR."""
        self.does_not_exist = error == DOES_NOT_EXIST
        self._fail(f"parameter {self._name}: {_REASONS.get(error, f'error {error}')}")

    def _handle_value(self, value: float) -> None:
        """Process the value that the vehicle has reported."""
        self._finish(value)

    def _describe(self) -> str:
        return f"the request for parameter {self._name}"


class _Set(ParamRequest):
    """Set one parameter and compare the reported value.

    If the type is needed and not known, the parameter is read first.

    Another value counts as a refusal when it has come after MAX_REFUSALS requests: a link can
    deliver reports of an earlier value late. A set that ended by one of them would still have its
    own request on the way, which changes the parameter later. PARAM_ERROR counts at once.
    """

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        order: ValueOrder,
        coding: ValueCoding,
        name: str,
        value: float,
    ) -> None:
        super().__init__(send, own, peer, order, coding, name)
        if not math.isfinite(value):
            raise ValueError(f"parameter {name}: {value} is no finite number")
        self._value = value
        self._requests = 0
        self._refused: set[int] = set()
        """Numbers of the requests after which another value has come."""

    def _send_request(self) -> None:
        """Send PARAM_SET, or the request for the value whose type is needed."""
        if not self._coding.is_known(self._name):
            super()._send_request()
            return
        try:
            field, kind = self._coding.encode(self._name, self._value)
        except ValueError as error:
            self._fail(f"parameter {self._name}: {error}")
            return
        if kind == REAL32:
            self._value = field
        self._requests += 1
        self._send_to_peer("PARAM_SET", param_id=self._name, param_value=field, param_type=kind)

    def _handle_value(self, value: float) -> None:
        """Finish if the vehicle reports the new value, and fail if it keeps another one."""
        if not self._requests:  # the answer that has the type
            self._note_progress()
            self._send_request()
            return
        if value == self._value:
            self._finish(value)
            return
        self._refused.add(self._requests)
        if len(self._refused) == MAX_REFUSALS:
            self._fail(
                f"parameter {self._name}: the vehicle keeps {value:g} and not {self._value:g}"
            )

    def _describe(self) -> str:
        return f"the setting of parameter {self._name}"


class _Listing(NamedTuple):
    """A parameter list that is being sent to a client."""

    room: RoomBytes
    """Room of the client's link."""
    position: int
    """Index of the next parameter to send."""


class ParamServer:
    """Server of the parameter protocol.

    A changed value is sent on every link, so that no client shows an old one. A PARAM_SET that a
    link delivers late is ignored: it has an older value.

    Parameters
    ----------
    table : ParamProvider
        The vehicle's parameters.
    broadcast : Send
        Function that sends a message on every link.
    explain : callable
        Send the operator the reason of a refusal.
    bytewise : bool
        Whether integers in PARAM_SET are bytes (PARAM_ENCODE_BYTEWISE) or numbers
        (PARAM_ENCODE_C_CAST): the encoding that the vehicle's capabilities advertise.
    """

    message_names = frozenset(("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"))

    def __init__(
        self,
        table: ParamProvider,
        broadcast: Send,
        explain: Callable[[str], None],
        *,
        bytewise: bool = True,
    ) -> None:
        self._bytewise = bytewise
        self._table, self._broadcast, self._explain = table, broadcast, explain
        self._names = tuple(table.names())
        self._listings: dict[Client, _Listing] = {}
        self._orders = FrameOrders()

    def feed(self, frame: Frame, send: Send, room: RoomBytes) -> None:
        """Process one frame that is addressed to this vehicle.

        Parameters
        ----------
        frame : Frame
            A frame of one of ``message_names``.
        send : Send
            Function that sends on the frame's link: the same object for every frame of a link.
        room : RoomBytes
            Return how many bytes of bulk data the frame's link accepts now.
        """
        sender = MavlinkId(frame.system, frame.component)
        message = frame.decode()
        match frame.name:
            case "PARAM_REQUEST_LIST":
                self._listings[Client(sender, send)] = _Listing(room, 0)
            case "PARAM_REQUEST_READ":
                self._read(message, sender, send)
            case "PARAM_SET":
                if not self._orders.of(Client(sender, send)).is_late(frame.sequence, wall_s()):
                    self._set(message, sender, send)

    def announce(self, name: str) -> None:
        """Send the value of a parameter on every link, after a change.

        Parameters
        ----------
        name : str
            Name of the parameter.
        """
        self._send_value(self._broadcast, name, self._names.index(name))

    def poll(self) -> None:
        """Send the next part of every requested list, as far as its link has room."""
        for client, (room, start) in list(self._listings.items()):
            position = start
            while (
                position < min(start + MAX_VALUES_PER_POLL, len(self._names))
                and room() >= _MAX_FRAME_BYTES
            ):
                self._send_value(client.send, self._names[position], position)
                position += 1
            if position < len(self._names):
                self._listings[client] = _Listing(room, position)
            else:
                del self._listings[client]

    def _read(self, message: Any, sender: MavlinkId, send: Send) -> None:
        """Answer PARAM_REQUEST_READ with the value or an error."""
        by_index = message.param_index >= 0
        if by_index and message.param_index < len(self._names):
            self._send_value(send, self._names[message.param_index], message.param_index)
        elif not by_index and message.param_id in self._names:
            self._send_value(send, message.param_id, self._names.index(message.param_id))
        else:
            _send_error(send, sender, message.param_id, message.param_index, DOES_NOT_EXIST)

    def _set(self, message: Any, sender: MavlinkId, send: Send) -> None:
        """Process PARAM_SET: send the new value on every link, or the error and the old value."""
        name = message.param_id
        if name not in self._names:
            self._explain(f"Parameter {name}: there is none of this name")
            _send_error(send, sender, name, -1, DOES_NOT_EXIST)
            return
        try:
            value = requested_value(
                name, message.param_value, message.param_type, bytewise=self._bytewise
            )
            self._table.set(name, value)
        except ValueError as refusal:
            self._explain(str(refusal))
            _send_error(send, sender, name, -1, OUT_OF_RANGE)
            self._send_value(send, name, self._names.index(name))
        else:
            self.announce(name)

    def _send_value(self, send: Send, name: str, index: int) -> None:
        """Send PARAM_VALUE."""
        send(
            "PARAM_VALUE",
            param_id=name,
            param_value=self._table.get(name),
            param_type=REAL32,
            param_count=len(self._names),
            param_index=index,
        )


def requested_value(name: str, value: float, param_type: int, *, bytewise: bool) -> float:
    """Return the value that a client has put into a PARAM_SET.

    Parameters
    ----------
    name : str
        Name of the parameter, for the reason of a refusal.
    value : float
        Field param_value.
    param_type : int
        MAV_PARAM_TYPE.
    bytewise : bool
        Whether the vehicle advertises PARAM_ENCODE_BYTEWISE (PX4): the bytes of the field are those
        of an integer. Else it advertises PARAM_ENCODE_C_CAST (ArduPilot): the field is the number.

    Raises
    ------
    ValueError
        The type does not fit into the field, or the value is not a finite number, or not whole
        for an integer type.
    """
    is_integer = param_type in _INTEGERS
    if is_integer and bytewise:
        if param_type not in INTEGER_FORMATS:
            raise ValueError(f"Parameter {name}: an integer of 64 bits does not fit into PARAM_SET")
        code = INTEGER_FORMATS[param_type]
        return float(struct.unpack(code, struct.pack("<f", value)[: struct.calcsize(code)])[0])
    if not math.isfinite(value):
        raise ValueError(f"Parameter {name}: {value} is not finite")
    if is_integer and value != round(value):
        raise ValueError(f"Parameter {name}: {value:g} is not a whole number, as its type says")
    return float(value)


def _send_error(send: Send, receiver: MavlinkId, name: str, index: int, error: int) -> None:
    """Send PARAM_ERROR."""
    send(
        "PARAM_ERROR",
        target_system=receiver.system,
        target_component=receiver.component,
        param_id=name,
        param_index=index,
        error=error,
    )
