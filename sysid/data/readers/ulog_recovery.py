"""What stands whole in a damaged .ulg: pyulog seeks byte by byte, or back and forth for ever, where
a size is wrong.

A ULog file is a header of 16 bytes and then messages, each a size (uint16), a type (one letter) and
so many bytes (PX4, "ULog File Format")."""

import struct
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

_HEADER_LENGTH = 16
_TYPES = frozenset(b"ABCDFILMOPQRST")
_MAX_MESSAGE_BYTES = 10_000
"""Bytes of a message that pyulog itself takes for undamaged."""
_RESYNC_MESSAGES = 3
"""So many messages in a row, where one was lost, are hardly there by chance."""
_head = struct.Struct("<HB")
MAX_FIELDS = 200_000
"""Number of fields of all logged topics together, nested formats included.

A log of PX4 has some 20 000.
"""
MAX_NAME_BYTES = 20_000_000
"""Length of the names of these fields together."""
MAX_NESTING = 16
"""Depth to which formats may contain each other. uORB topics use 3."""
_FORMAT, _SUBSCRIPTION = ord("F"), ord("A")
_SCALAR_TYPES = frozenset(f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64))
_SCALAR_TYPES |= {"float", "double", "bool", "char"}
_FLAGS, _APPENDED = ord("B"), 16
"""The message whose bytes from the sixteenth on say where in the file further data were
appended."""


def keep_sound_messages(data: bytes) -> bytes:
    """The file with those of its messages that are sound, in their order; a sound file as it is."""
    kept, at, lost = [data[:_HEADER_LENGTH]], _HEADER_LENGTH, False
    while at < len(data):
        end = _end(data, at)
        if end is None or (lost and not _is_message_sequence(data, at)):
            lost, at = True, at + 1
            continue
        kept.append(_clear_appended_offsets(data[at:end]))
        at, lost = end, False
    return b"".join(kept)


def _end(data: bytes, at: int) -> int | None:
    """Where the message ends that begins here; None where none does."""
    if at + _head.size > len(data):
        return None
    size, kind = _head.unpack_from(data, at)
    end = at + _head.size + size
    return end if kind in _TYPES and 0 < size <= _MAX_MESSAGE_BYTES and end <= len(data) else None


def _is_message_sequence(data: bytes, at: int) -> bool:
    """Whether _CHAIN messages follow each other from here, or as many as there are up to the
    end."""
    for _ in range(_RESYNC_MESSAGES):
        if at == len(data):
            return True
        end = _end(data, at)
        if end is None:
            return False
        at = end
    return True


def _clear_appended_offsets(message: bytes) -> bytes:
    """Flags without the places of appended data, which stand in the order of the file anyway."""
    if message[2] != _FLAGS or len(message) < _head.size + _APPENDED:
        return message
    return message[: _head.size + _APPENDED] + bytes(len(message) - _head.size - _APPENDED)


class _Expansion(NamedTuple):
    """What pyulog makes of a format: a list of every element of every array by its full name."""

    fields: int
    name_bytes: int


class _Field(NamedTuple):
    type: str
    length: int
    """Of an array; 1 for a single value."""
    name: str


_Formats = dict[str, list[list[_Field]]]
"""The fields of each format by its name; a damaged file may define a name more than once."""


def refuse_large_formats(data: bytes) -> None:
    """Raise ValueError where the topics of a mended file expand to more fields than the limits."""
    formats: _Formats = defaultdict(list)
    topics: list[str] = []
    for kind, body in _messages(data):
        if kind == _FORMAT:
            name, _, fields = body.decode("utf-8", "ignore").partition(":")
            formats[name].append(_parsed_fields(fields))
        elif kind == _SUBSCRIPTION:
            topics.append(body[3:].decode("utf-8", "ignore"))
    known: dict[str, _Expansion] = {}
    number = name_bytes = 0
    for topic in topics:
        expansion = _expanded(topic, formats, known, 0)
        number, name_bytes = number + expansion.fields, name_bytes + expansion.name_bytes
        if number > MAX_FIELDS or name_bytes > MAX_NAME_BYTES:
            raise ValueError(f"its formats declare more than {MAX_FIELDS} fields")


def _messages(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = _HEADER_LENGTH
    while at + _head.size <= len(data):
        size, kind = _head.unpack_from(data, at)
        at += _head.size
        yield kind, data[at : at + size]
        at += size


def _parsed_fields(text: str) -> list[_Field]:
    """The fields of a format, ``TYPE[COUNT] NAME;`` each, cut where pyulog cuts them."""
    fields = []
    for part in text.partition(":")[0].split(";"):
        kind, _, name = part.partition(" ")
        start = kind.find("[")
        count = kind[start + 1 : kind.find("]")] if start >= 0 else "1"
        try:
            # pyulog reads a count of 0 as a single field, and refuses those beyond uint16
            fields.append(_Field(kind.partition("[")[0], max(1, min(int(count), 0xFFFF)), name))
        except ValueError:
            continue
    return fields


def _expanded(name: str, formats: _Formats, known: dict[str, _Expansion], depth: int) -> _Expansion:
    """The largest expansion of the formats of a name. Raises ValueError for too deep a nesting."""
    if depth > MAX_NESTING:
        raise ValueError(f"its formats are nested deeper than {MAX_NESTING}")
    if name not in known:
        variants = [_sum(fields, formats, known, depth) for fields in formats.get(name, ())]
        known[name] = max(variants, default=_Expansion(0, 0))
    return known[name]


def _sum(
    fields: list[_Field],
    formats: _Formats,
    known: dict[str, _Expansion],
    depth: int,
) -> _Expansion:
    number = name_bytes = 0
    for field in fields:
        scalar = field.type in _SCALAR_TYPES
        inner = _Expansion(1, 0) if scalar else _expanded(field.type, formats, known, depth + 1)
        number += field.length * inner.fields
        name_bytes += field.length * (inner.name_bytes + inner.fields * (len(field.name) + 8))
    return _Expansion(number, name_bytes)
