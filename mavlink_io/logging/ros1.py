"""A MAVLink payload read as a ROS 1 message.

A payload at full length holds its fields in wire order, little-endian and unpadded, arrays at fixed
length: exactly what ROS 1 serialisation writes for a message definition with the same fields. So a
schema is all that a log needs for Foxglove, PlotJuggler or any ROS reader to decode it, and the
payload is stored as it came."""

import struct
from collections.abc import Callable

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
"""Fields that hold vehicle time, and their unit. A ``time_usec`` of 32 bits wraps after 72 minutes
and tells none."""
_MAX_UPTIME_US = 10**14
"""Three years: a larger ``time_usec`` is a UNIX time, which says nothing about the vehicle's
clock."""


def schema_name(message: MessageType) -> str:
    """The ROS 1 type name of a message."""
    return f"mavlink/{message.name}"


def schema_text(message: MessageType) -> str:
    """The ROS 1 message definition: one line a field in wire order, units as comments."""
    return "".join(_line(field) for field in message.fields)


def vehicle_time_reader(message: MessageType) -> Callable[[bytes], int | None] | None:
    """How to read the vehicle time in microseconds from a full-length payload.

    Returns:
        A function of the payload, whose result is None where the field holds a UNIX time or
        nothing; None for a message that carries no time.
    """
    offset = 0
    for field in message.fields:
        kind = _SCALARS[field.type][1]
        scale = _TIME_SCALES_US.get((field.name, field.type))
        if scale is not None and not field.array_length:
            return _reader(struct.Struct(f"<{kind}"), offset, scale)
        offset += struct.calcsize(kind) * max(1, field.array_length)
    return None


def _reader(number: struct.Struct, offset: int, scale: int) -> Callable[[bytes], int | None]:
    def read(payload: bytes) -> int | None:
        time_us: int = number.unpack_from(payload, offset)[0] * scale
        return time_us if time_us < _MAX_UPTIME_US else None

    return read


def _line(field: MessageField) -> str:
    ros_type = _SCALARS[field.type][0]
    array = f"[{field.array_length}]" if field.array_length else ""
    notes = [
        note
        for note in (field.unit, "text, ends at the first zero" if field.type == "char" else "")
        if note
    ]
    return f"{ros_type}{array} {field.name}{'  # ' + ', '.join(notes) if notes else ''}\n"
