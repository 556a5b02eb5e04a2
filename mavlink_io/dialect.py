"""The MAVLink dialect: fields and packing of every message, and the enums.

This is the only file that imports pymavlink. The dialect is ``all``, because pymavlink's ``common``
lacks AVAILABLE_MODES and CURRENT_MODE. Two messages of ``common.xml`` that ``all`` lacks too, and
the target of TIMESYNC, are added here.
"""

import inspect
import math
import struct
from collections import namedtuple
from functools import cache, cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

Message = Any
"""A decoded message: a namedtuple of its fields in wire order."""
Values = tuple[Any, ...]
"""The fields of a message in wire order."""


class MessageField(NamedTuple):
    """One field of a message."""

    name: str
    type: str
    """MAVLink's type without its array length: ``uint8_t``, ``float``, ``char`` ..."""
    array_length: int
    """Number of elements; 0 for a scalar."""
    unit: str
    """Unit in MAVLink's notation, such as ``rad/s``; "" if it has none."""


class MessageType:
    """One message of the dialect: its number, its fields and the packing of its payload.

    Parameters
    ----------
    definition : type
        Message class of pymavlink, or an object with the same attributes.
    """

    def __init__(self, definition: Any) -> None:
        self.name: str = definition.msgname
        self.message_id: int = definition.id
        self.crc_extra: int = definition.crc_extra
        """Seed of the CRC: a checksum of the message's definition."""
        self.crc_seed = bytes((self.crc_extra,))
        types = dict(zip(definition.fieldnames, definition.fieldtypes, strict=True))
        units = definition.fieldunits_by_name
        self.fields = tuple(
            MessageField(name=name, type=types[name], array_length=length, unit=units.get(name, ""))
            for name, length in zip(
                definition.ordered_fieldnames, definition.array_lengths, strict=True
            )
        )
        # "s" and not "c": a text of one character may be empty, which "c" refuses
        self.struct = struct.Struct(definition.unpacker.format.replace("c", "s"))
        self._slices = tuple(_slices(self.fields))
        self._names = dict.fromkeys(f.name for f in self.fields)
        self._has_arrays = any(f.array_length for f in self.fields)
        self._compounds = tuple(
            index
            for index in reversed(range(len(self.fields)))
            if self.fields[index].array_length or self.fields[index].type == "char"
        )
        """Indices of texts and arrays, the last one first, so that the others stay valid."""
        self._construct = definition.__init__

    # cached properties, because a program looks up many message types at its start and uses few
    @cached_property
    def record(self) -> Any:
        """Namedtuple type of a decoded message."""
        return namedtuple(self.name, [f.name for f in self.fields])

    @cached_property
    def _extensions(self) -> dict[str, Any]:
        """Default of each field that may be left out."""
        parameters = inspect.signature(self._construct).parameters
        return {
            n: p.default for n, p in parameters.items() if p.default is not inspect.Parameter.empty
        }

    def values(self, **fields: Any) -> tuple[Any, ...]:
        """Return fields in wire order.

        Parameters
        ----------
        **fields
            Fields by name; extension fields may be left out.

        Returns
        -------
        tuple
            All fields in wire order.

        Raises
        ------
        TypeError
            A field is unknown, or a field that is no extension is missing.
        """
        if fields.keys() == self._names.keys():
            return tuple([fields[name] for name in self._names])
        try:
            ordered = tuple(
                fields.pop(name) if name in fields else self._extensions[name]
                for name in self._names
            )
        except KeyError as missing:
            raise TypeError(f"{self.name} needs field {missing}") from None
        if fields:
            raise TypeError(f"{self.name} has no field {', '.join(fields)}")
        return ordered

    def pack(self, values: tuple[Any, ...]) -> bytes:
        """Pack fields into a payload at full length.

        Parameters
        ----------
        values : tuple
            Fields in wire order.

        Returns
        -------
        bytes
            The payload.

        Raises
        ------
        TypeError
            An array has the wrong number of elements.
        struct.error
            A number does not fit into its field.
        """
        if not self._has_arrays:
            return self.struct.pack(*values)
        flat = list(values)
        for index in self._compounds:
            field, value = self.fields[index], flat[index]
            if field.type == "char":
                flat[index] = value.encode() if isinstance(value, str) else value
            elif len(value) == field.array_length:
                flat[index : index + 1] = value
            else:
                raise TypeError(
                    f"{self.name}.{field.name} holds {field.array_length} numbers, not {len(value)}"
                )
        return self.struct.pack(*flat)

    def clamped(self, values: Values) -> Values:
        """Return fields with each number limited to the range of its field.

        Parameters
        ----------
        values : tuple
            Fields in wire order.

        Returns
        -------
        tuple
            Fields in wire order that ``pack`` accepts.
        """
        return tuple(
            _clamp_field(field, value) for field, value in zip(self.fields, values, strict=True)
        )

    def unpack(self, payload: bytes) -> Message:
        """Unpack a payload.

        Parameters
        ----------
        payload : bytes
            The payload; trailing zeros may be missing.

        Returns
        -------
        namedtuple
            The fields in wire order.
        """
        size = self.struct.size
        flat = self.struct.unpack(payload[:size].ljust(size, b"\0"))
        if not self._has_arrays:
            return self.record._make(flat)
        return self.record._make(
            (
                _text(flat[start])
                if isinstance(flat[start], bytes)
                else flat[start]
                if count == 0
                else flat[start:stop]
            )
            for start, stop, count in self._slices
        )


_INTEGER_LIMITS = {
    f"{sign}int{bits}_t": (0, (1 << bits) - 1) if sign else (-(1 << bits - 1), (1 << bits - 1) - 1)
    for sign in ("u", "")
    for bits in (8, 16, 32, 64)
} | {"uint8_t_mavlink_version": (0, 255)}
"""Minimum and maximum of an integer field, by MAVLink's type."""
_MAX_FLOAT32 = 3.402_823_466_385_288_6e38
"""The largest finite float32: (2 - 2^-23) 2^127 (IEEE 754)."""


def _clamp_field(field: MessageField, value: Any) -> Any:
    """Return a field's value limited to the range of its type; NaN and infinity are unchanged."""
    if field.array_length and field.type != "char":
        scalar = field._replace(array_length=0)
        return tuple(_clamp_field(scalar, element) for element in value)
    if field.type == "float" and math.isfinite(value):
        return max(-_MAX_FLOAT32, min(_MAX_FLOAT32, value))
    if field.type in _INTEGER_LIMITS and isinstance(value, int):
        minimum, maximum = _INTEGER_LIMITS[field.type]
        return max(minimum, min(maximum, value))
    return value


def _definition(
    name: str, number: int, crc_extra: int, packing: str, **types: tuple[str, int]
) -> Any:
    """Return a message definition in pymavlink's form.

    ``types`` contains type and array length of each field in wire order.
    """

    def construct(self: Any, **fields: Any) -> None:
        raise NotImplementedError

    construct.__signature__ = inspect.Signature()  # type: ignore[attr-defined]
    return SimpleNamespace(
        msgname=name,
        id=number,
        crc_extra=crc_extra,
        fieldnames=list(types),
        ordered_fieldnames=list(types),
        fieldtypes=[kind for kind, _ in types.values()],
        array_lengths=[length for _, length in types.values()],
        fieldunits_by_name={},
        unpacker=SimpleNamespace(format=packing),
        __init__=construct,
    )


_ADDED = {
    definition.id: definition
    for definition in (
        _definition(
            "COMMAND_CANCEL",
            80,
            14,
            "<HBB",
            command=("uint16_t", 0),
            target_system=("uint8_t", 0),
            target_component=("uint8_t", 0),
        ),
        _definition(
            "TIMESYNC",
            111,
            34,
            "<qqBB",
            tc1=("int64_t", 0),
            ts1=("int64_t", 0),
            target_system=("uint8_t", 0),
            target_component=("uint8_t", 0),
        ),
        _definition(
            "COMPONENT_METADATA",
            397,
            182,
            "<II100s",
            time_boot_ms=("uint32_t", 0),
            file_crc=("uint32_t", 0),
            uri=("char", 100),
        ),
    )
}
"""Definitions by message number of messages that clients use and pymavlink 2.4.50 lacks, and of
TIMESYNC, whose target it lacks."""
_DEFINITIONS = {**mavlink.mavlink_map, **_ADDED}
_NUMBERS = {definition.msgname: number for number, definition in _DEFINITIONS.items()}


def _slices(fields: tuple[MessageField, ...]) -> list[tuple[int, int, int]]:
    """Return start, stop and array length of each field in the flat tuple of ``struct``."""
    slices, start = [], 0
    for field in fields:
        width = field.array_length if field.array_length and field.type != "char" else 1
        slices.append((start, start + width, field.array_length))
        start += width
    return slices


def _text(raw: bytes) -> str:
    """Return the text before the first zero byte; broken UTF-8 is replaced."""
    return raw.split(b"\0", 1)[0].decode("utf-8", "replace")


@cache
def by_name(name: str) -> MessageType:
    """Return the message type of a name.

    Parameters
    ----------
    name : str
        Name of the message, such as "HEARTBEAT".

    Returns
    -------
    MessageType
        The same object at every call.

    Raises
    ------
    KeyError
        The dialect has no such message.
    """
    number = _NUMBERS.get(name)
    if number is None:
        raise KeyError(f"the MAVLink dialect has no message {name}")
    return MessageType(_DEFINITIONS[number])


@cache
def by_id(message_id: int) -> MessageType | None:
    """Return the message type of a message number.

    Parameters
    ----------
    message_id : int
        Number of the message.

    Returns
    -------
    MessageType or None
        The same object at every call; None if the dialect has no such message.
    """
    definition = _DEFINITIONS.get(message_id)
    return None if definition is None else by_name(definition.msgname)


def names() -> list[str]:
    """Return the names of all messages of the dialect.

    Returns
    -------
    list of str
        Names in the order of the message numbers.
    """
    return [_DEFINITIONS[message_id].msgname for message_id in sorted(_DEFINITIONS)]


def constant(name: str) -> int:
    """Return the value of an enum entry of the dialect.

    Parameters
    ----------
    name : str
        Name of the entry, such as "MAV_RESULT_ACCEPTED".

    Returns
    -------
    int
        Value of the entry.

    Raises
    ------
    KeyError
        The dialect has no such entry.
    """
    value = getattr(mavlink, name, None)
    if not isinstance(value, int):
        raise KeyError(f"the MAVLink dialect has no constant {name}")
    return value


def enum_names(enum: str) -> dict[int, str]:
    """Return the entries of an enum of the dialect.

    Parameters
    ----------
    enum : str
        Name of the enum, such as "MAV_RESULT".

    Returns
    -------
    dict
        Names of the entries by value, without the end marker.
    """
    return {
        value: entry.name
        for value, entry in mavlink.enums[enum].items()
        if not entry.name.endswith("ENUM_END")
    }


def has_location(command: int) -> bool:
    """Return whether the parameters 5 to 7 of a command are a position.

    Parameters
    ----------
    command : int
        MAV_CMD.

    Returns
    -------
    bool
        True if x and y are an angle or offset and z is a height.
    """
    entry = mavlink.enums["MAV_CMD"].get(command)
    return entry is not None and bool(entry.has_location)
