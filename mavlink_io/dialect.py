"""The MAVLink dialect: every message's fields, as pymavlink generated them. The only file that
imports pymavlink.

The dialect is ``all``: pymavlink's ``common`` lacks AVAILABLE_MODES and CURRENT_MODE. Two messages
of ``common.xml`` that even ``all`` lacks are added here."""

import inspect
import math
import struct
from collections import namedtuple
from functools import cache, cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

Message = Any
"""A decoded message: a namedtuple of the message's fields in wire order."""
Values = tuple[Any, ...]
"""A message's fields in wire order."""


class MessageField(NamedTuple):
    name: str
    type: str
    """MAVLink's type without its array length: ``uint8_t``, ``float``, ``char`` ..."""
    array_length: int
    """0 for a scalar."""
    unit: str


class MessageType:
    """One message of the dialect: its number, fields and the packing of its payload."""

    def __init__(self, definition: Any) -> None:
        self.name: str = definition.msgname
        self.message_id: int = definition.id
        self.crc_extra: int = definition.crc_extra
        self.crc_seed = bytes((self.crc_extra,))
        types = dict(zip(definition.fieldnames, definition.fieldtypes, strict=True))
        units = definition.fieldunits_by_name
        self.fields = tuple(
            MessageField(name, types[name], length, units.get(name, ""))
            for name, length in zip(
                definition.ordered_fieldnames, definition.array_lengths, strict=True
            )
        )
        # A text of one character is a text too, and may be empty: "s" takes what "c" refuses.
        self.struct = struct.Struct(definition.unpacker.format.replace("c", "s"))
        self._slices = tuple(_slices(self.fields))
        self._has_arrays = any(f.array_length for f in self.fields)
        self._construct = definition.__init__

    # Whoever starts names many messages and uses few: what takes long to make is made when it is
    # wanted.
    @cached_property
    def record(self) -> Any:
        """The type of a decoded message."""
        return namedtuple(self.name, [f.name for f in self.fields])

    @cached_property
    def _extensions(self) -> dict[str, Any]:
        """Value of each field that may be left out."""
        parameters = inspect.signature(self._construct).parameters
        return {
            n: p.default for n, p in parameters.items() if p.default is not inspect.Parameter.empty
        }

    def values(self, **fields: Any) -> tuple[Any, ...]:
        """The given fields in wire order; extension fields may be left out.

        Raises:
            TypeError: a field is unknown, or one that is no extension is missing.
        """
        try:
            ordered = tuple(
                fields.pop(f.name) if f.name in fields else self._extensions[f.name]
                for f in self.fields
            )
        except KeyError as missing:
            raise TypeError(f"{self.name} needs field {missing}") from None
        if fields:
            raise TypeError(f"{self.name} has no field {', '.join(fields)}")
        return ordered

    def pack(self, values: tuple[Any, ...]) -> bytes:
        """The payload at full length of fields in wire order."""
        if not self._has_arrays:
            return self.struct.pack(*values)
        flat: list[Any] = []
        for field, value in zip(self.fields, values, strict=True):
            if field.type == "char":
                flat.append(value.encode() if isinstance(value, str) else value)
            elif field.array_length:
                if len(value) != field.array_length:
                    raise TypeError(
                        f"{self.name}.{field.name} holds {field.array_length} numbers, not"
                        f" {len(value)}"
                    )
                flat.extend(value)
            else:
                flat.append(value)
        return self.struct.pack(*flat)

    def clamped(self, values: Values) -> Values:
        """Return the values; a number that its field cannot hold becomes the nearest that it
        can."""
        return tuple(
            _clamped(field, value) for field, value in zip(self.fields, values, strict=True)
        )

    def unpack(self, payload: bytes) -> Message:
        """The fields of a payload, whose trailing zeros may have been cut off."""
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
"""Smallest and largest number of an integer field, by MAVLink's type."""
_LARGEST_FLOAT = 3.402_823_466_385_288_6e38
"""The largest finite float32: (2 - 2^-23) 2^127 (IEEE 754)."""


def _clamped(field: MessageField, value: Any) -> Any:
    if field.array_length and field.type != "char":
        return tuple(_clamped(field._replace(array_length=0), each) for each in value)
    if field.type == "float" and math.isfinite(value):
        return max(-_LARGEST_FLOAT, min(_LARGEST_FLOAT, value))
    if field.type in _INTEGER_LIMITS and isinstance(value, int):
        least, most = _INTEGER_LIMITS[field.type]
        return max(least, min(most, value))
    return value


def _definition(
    name: str, number: int, crc_extra: int, packing: str, **types: tuple[str, int]
) -> Any:
    """A message as pymavlink defines its own, its fields (type and array length) in wire order."""

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
"""By message number: what clients of today send and ask for, and pymavlink 2.4.50 does not know."""
_DEFINITIONS = {**mavlink.mavlink_map, **_ADDED}
_NUMBERS = {definition.msgname: number for number, definition in _DEFINITIONS.items()}


def _slices(fields: tuple[MessageField, ...]) -> list[tuple[int, int, int]]:
    slices, start = [], 0
    for field in fields:
        width = field.array_length if field.array_length and field.type != "char" else 1
        slices.append((start, start + width, field.array_length))
        start += width
    return slices


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("utf-8", "replace")


@cache
def by_name(name: str) -> MessageType:
    """The message type called ``name``; KeyError when the dialect has none."""
    number = _NUMBERS.get(name)
    if number is None:
        raise KeyError(f"the MAVLink dialect has no message {name}")
    return MessageType(_DEFINITIONS[number])


@cache
def by_id(message_id: int) -> MessageType | None:
    """The message type numbered ``message_id``, or None when the dialect has none."""
    definition = _DEFINITIONS.get(message_id)
    return None if definition is None else by_name(definition.msgname)


def names() -> list[str]:
    """Every message name of the dialect, in the order of the message numbers."""
    return [_DEFINITIONS[message_id].msgname for message_id in sorted(_DEFINITIONS)]


def constant(name: str) -> int:
    """The value of a dialect enum entry, such as ``MAV_CMD_NAV_DELAY``; KeyError when there is
    none."""
    value = getattr(mavlink, name, None)
    if not isinstance(value, int):
        raise KeyError(f"the MAVLink dialect has no constant {name}")
    return value


def enum_names(enum: str) -> dict[int, str]:
    """The entries of a dialect enum by value, without the end marker."""
    return {
        value: entry.name
        for value, entry in mavlink.enums[enum].items()
        if not entry.name.endswith("ENUM_END")
    }


def has_location(command: int) -> bool:
    """Whether a MAV_CMD names a place: x and y an angle or offset, z a height."""
    entry = mavlink.enums["MAV_CMD"].get(command)
    return entry is not None and bool(entry.has_location)
