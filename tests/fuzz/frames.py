"""MAVLink frames from arbitrary bytes: correct CRC, fields from the bytes or from edge values.

Random bytes hardly ever form a frame with a correct CRC, so a fuzzer on the raw stream would test
the framer alone. Here the bytes select messages, fields and faults; equal bytes give equal frames.
"""

import math
import struct
from collections.abc import Sequence

from mavlink_io import dialect
from mavlink_io.codec import encode
from mavlink_io.dialect import MessageField, MessageType
from mavlink_io.mission_items import MavCmd

MAX_FRAMES = 64
"""Maximum number of frames of one case."""
SENDERS = ((255, 190), (255, 190), (254, 1), (1, 25), (1, 1), (0, 0))
"""Ids of the senders: two ground stations, a device of the vehicle, the vehicle, a broadcast."""
_SIZES = {"char": 1, "float": 4, "double": 8}
_SIZES |= {f"{sign}int{bits}_t": bits // 8 for bits in (8, 16, 32, 64) for sign in ("", "u")}
_REALS = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    21196.0,
    1e-40,
    -1e-40,
    3.4e38,
    -3.4e38,
    1e9,
    math.nan,
    math.inf,
    -math.inf,
    0.02,
    58.0,
    100.0,
    180.0,
    -180.0,
    65_536.0,
    84_148_224.0,
)
"""Edge values of a real field."""
_COMMANDS: tuple[int, ...] = (*MavCmd, 0, 65_535)
"""Numbers of commands."""


class ByteSource:
    """Reads numbers from bytes; zeros follow the last byte."""

    def __init__(self, data: bytes) -> None:
        self._data, self._place = data, 0

    @property
    def empty(self) -> bool:
        """Whether all bytes were read."""
        return self._place >= len(self._data)

    def take(self, count: int) -> bytes:
        """Return the next bytes."""
        taken = self._data[self._place : self._place + count]
        self._place += count
        return taken.ljust(count, b"\0")

    def byte(self) -> int:
        """Return the next byte."""
        return self.take(1)[0]


def stream(data: bytes, messages: Sequence[MessageType]) -> bytes:
    """Return the bytes of a link: frames of some messages, a few of them damaged."""
    source, sent = ByteSource(data), b""
    for sequence in range(MAX_FRAMES):
        if source.empty:
            break
        choice, fault = source.byte(), source.byte()
        message = messages[choice % len(messages)]
        system, component = SENDERS[fault % len(SENDERS)]
        values = tuple(field_value(source, field) for field in message.fields)
        frame = encode(message, values, sequence, system, component)
        if fault >= 248:
            frame = damaged(frame, fault, source)
        sent += frame
    return sent


def damaged(frame: bytes, fault: int, source: ByteSource) -> bytes:
    """Return a frame that is cut, has a changed byte, or follows noise."""
    if fault < 250:
        return frame[: source.byte() % len(frame)]
    if fault < 253:
        place = source.byte() % len(frame)
        return frame[:place] + source.take(1) + frame[place + 1 :]
    return source.take(source.byte()) + frame


def field_value(source: ByteSource, field: MessageField) -> object:
    """Return a value of a field: usually an edge value, else one of the bytes."""
    size, count = _SIZES[field.type], field.array_length
    if field.type == "char":
        return text(source, count or 1)
    if not count:
        return number(source, field, size)
    if size == 1 and count > 16:  # payload of a file transfer, of data or of a key
        raw = source.take(min(count, 24)).ljust(count, b"\0")
        return tuple(struct.unpack(f"<{count}{'B' if field.type[0] == 'u' else 'b'}", raw))
    values = [number(source, field, size) for _ in range(min(count, 4))]
    return tuple((values * count)[:count])


def text(source: ByteSource, length: int) -> bytes:
    """Return a text: a name that the vehicle knows, or any bytes."""
    known = (b"HDG_P", b"THR_CRUISE_PCT", b"FS_DEPTH_M", b"MAV_SYS_ID", b"SID_AXIS", b"LOG_MAX_MB")
    choice = source.byte()
    return (known[choice % len(known)] if choice < 224 else source.take(choice % 17))[:length]


def number(source: ByteSource, field: MessageField, size: int) -> float | int:
    """Return a number of the field's type."""
    selector = source.byte()
    if field.type in ("float", "double"):
        if selector < 192:
            return _REALS[selector % len(_REALS)]
        layout = "<f" if size == 4 else "<d"
        return float(struct.unpack(layout, source.take(size))[0])
    bits, signed = 8 * size, field.type[0] != "u"
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if field.name in ("target_system", "target_component", "target") and selector < 240:
        return selector % 5 != 0
    if field.name == "command" and selector < 240:
        return _COMMANDS[selector % len(_COMMANDS)]
    if selector < 160:
        edges = (0, 1, 2, 3, low, high, high - 1, high // 2 + 1)
        return min(high, max(low, edges[selector % len(edges)]))
    value = int.from_bytes(source.take(size), "little", signed=signed)
    return min(high, value % 1000) if selector < 208 else value


def messages_by_name(*names: str) -> tuple[MessageType, ...]:
    """Return the types of messages."""
    return tuple(dialect.by_name(name) for name in names)
