"""ROS 1 schemas of MAVLink messages.

A payload at full length contains the fields in wire order, little-endian, without padding, with
arrays of fixed length. ROS 1 serialisation writes the same bytes for a message definition with the
same fields. A log therefore stores payloads unchanged, and with the schema Foxglove, PlotJuggler
and every ROS reader can decode them.
"""

import struct
from collections.abc import Callable
from functools import cache

from mavlink_io import dialect
from mavlink_io.dialect import MessageField, MessageType

SCHEMA_ENCODING = "ros1msg"
MESSAGE_ENCODING = "ros1"

_SCALARS = {
    "uint8_t": ("uint8", "B"),
    "int8_t": ("int8", "b"),
    "uint16_t": ("uint16", "H"),
    "int16_t": ("int16", "h"),
    "uint32_t": ("uint32", "I"),
    "int32_t": ("int32", "i"),
    "uint64_t": ("uint64", "Q"),
    "int64_t": ("int64", "q"),
    "float": ("float32", "f"),
    "double": ("float64", "d"),
    "char": ("uint8", "B"),
}
_TIME_SCALES_US = {
    ("time_boot_ms", "uint32_t"): 1000,
    ("time_boot_us", "uint64_t"): 1,
    ("time_usec", "uint64_t"): 1,
}
"""Unit in microseconds of each field with vehicle time, by name and type.

A 32-bit ``time_usec`` is not used, because it wraps after 72 minutes."""
_MAX_UPTIME_US = 10**14
"""Three years: a larger ``time_usec`` is a UNIX time and not the vehicle's clock."""


def schema_name(message: MessageType) -> str:
    """Return the ROS 1 type name of a message.

    Parameters
    ----------
    message : MessageType
        Type of the message.

    Returns
    -------
    str
        Name such as "mavlink/ATTITUDE".
    """
    return f"mavlink/{message.name}"


def schema_text(message: MessageType) -> str:
    """Return the ROS 1 message definition of a message.

    Parameters
    ----------
    message : MessageType
        Type of the message.

    Returns
    -------
    str
        One line per field in wire order, with units as comments.
    """
    return "".join(_line(field) for field in message.fields)


@cache
def time_reader(message_id: int) -> Callable[[bytes], int | None] | None:
    """Return a function that reads the vehicle time from a payload.

    Parameters
    ----------
    message_id : int
        Number of the message.

    Returns
    -------
    callable or None
        Function of the full-length payload that returns the vehicle time in microseconds, or None
        if the field contains a UNIX time. None for a message without a time field, or one that the
        dialect does not define.
    """
    message, offset = dialect.by_id(message_id), 0
    for field in message.fields if message else ():
        kind = _SCALARS[field.type][1]
        scale = _TIME_SCALES_US.get((field.name, field.type))
        if scale is not None and not field.array_length:
            return _reader(struct.Struct(f"<{kind}"), offset, scale)
        offset += struct.calcsize(kind) * max(1, field.array_length)
    return None


def _reader(number: struct.Struct, offset: int, scale: int) -> Callable[[bytes], int | None]:
    """Return a function that reads a number in microseconds at an offset of a payload."""

    def read(payload: bytes) -> int | None:
        time_us: int = number.unpack_from(payload, offset)[0] * scale
        return time_us if time_us < _MAX_UPTIME_US else None

    return read


def _line(field: MessageField) -> str:
    """Return the line of a field in the message definition."""
    ros_type = _SCALARS[field.type][0]
    array = f"[{field.array_length}]" if field.array_length else ""
    notes = [
        note
        for note in (field.unit, "text, ends at the first zero" if field.type == "char" else "")
        if note
    ]
    return f"{ros_type}{array} {field.name}{'  # ' + ', '.join(notes) if notes else ''}\n"
