"""Extract the undamaged messages of a .ulg before pyulog reads it.

At a wrong size pyulog searches byte by byte, or does not return. A ULog file is a header of 16
bytes followed by messages, each with a size (uint16), a type (one letter) and a body of that size
(PX4, "ULog File Format").
"""

import re
import struct
from collections import Counter, defaultdict, deque
from collections.abc import Collection, Iterator
from typing import NamedTuple

from sysid.data.readers.samples import FileDamage

_HEADER_LENGTH = 16
_TYPES = frozenset(b"ABCDFILMOPQRS")
_MAX_MESSAGE_BYTES = 10_000
"""Maximum size of a message body that pyulog accepts as undamaged."""
_RESYNC_MESSAGES = 3
"""Number of consecutive valid messages required after damage, so that a chance match is unlikely.
"""
_head = struct.Struct("<HB")
MAX_FIELDS = 200_000
"""Maximum number of fields of all logged topics, including nested formats.

A PX4 log has about 20 000.
"""
MAX_NAME_BYTES = 20_000_000
"""Maximum total length of the names of these fields."""
MAX_NESTING = 16
"""Maximum nesting of formats; uORB topics use 3."""
_FORMAT, _SUBSCRIPTION, _DATA, _TEXT, _PARAMETER = map(ord, "FADLP")
_NO_FORMAT = re.compile(rb"[^\x20-\x7e]")
_LEVELS = b"01234567"
"""First bytes of logged texts. One flipped bit makes a format or a text of a sample."""
_PARAMETER_KEY = re.compile(rb"(?:int32_t|float) [A-Z0-9_]+")
_PARAMETER_VALUE = 4
"""Length of the value of a parameter."""
_stamp = struct.Struct("<Q")
_SAMPLE_TIME, _TEXT_TIME = 2, 1
"""Offsets of the time stamp in samples and texts."""
_EARLIER_SAMPLES = 10
"""Number of samples before a text with which its time is compared."""
_TEXT_AHEAD_US, _TEXT_BEHIND_US = 100_000, 1_000_000
"""Largest time by which a text is later and earlier than the samples written before it. In five
logs of PX4 (pyulog's test files) 30 texts are at most 1 ms later and 0.4 s earlier."""
_SCALAR_TYPES = frozenset(f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64))
_SCALAR_TYPES |= {"float", "double", "bool", "char"}
_FLAGS, _APPENDED = ord("B"), 16
"""Type of the flags message; bytes from the sixteenth on are file offsets of appended data."""


def keep_sound_messages(data: bytes) -> tuple[bytes, FileDamage]:
    """Return the file with its undamaged messages only, and its damage.

    An undamaged file is not changed, but offsets of appended data in the flags message are set to
    zero.
    """
    sound_parts, offset, lost = [data[:_HEADER_LENGTH]], _HEADER_LENGTH, False
    sound_end, skipped, topics = _HEADER_LENGTH, list[int](), set[bytes]()
    usual_size, recent_us = _usual_sizes(data), deque[int](maxlen=_EARLIER_SAMPLES)
    while offset < len(data):
        end = _end(data, offset)
        if end is None or (lost and not _is_message_sequence(data, offset)):
            lost, offset = True, offset + 1
            continue
        kind, topic = data[offset + 2], data[offset + 3 : offset + 5]
        if kind == _DATA and (topic not in topics or end - offset != usual_size[topic]):
            offset = end  # a sample of no topic or of another size: pyulog drops it without a word
            continue
        if kind == _TEXT and _is_unsound(data[offset + _head.size : end], recent_us):
            offset = end
            continue
        if kind == _SUBSCRIPTION:
            topics.add(data[offset + 4 : offset + 6])
        if kind == _DATA and end - offset >= _head.size + _SAMPLE_TIME + _stamp.size:
            recent_us.append(_stamp.unpack_from(data, offset + _head.size + _SAMPLE_TIME)[0])
        if offset > sound_end:
            skipped.append(offset - sound_end)
        sound_parts.append(_clear_appended_offsets(data[offset:end]))
        offset, lost, sound_end = end, False, end
    damage = FileDamage(sum(skipped), len(skipped), max(len(data) - sound_end, 0))
    return b"".join(sound_parts), damage


def _usual_sizes(data: bytes) -> dict[bytes, int]:
    """Return the usual size of the samples of each topic number."""
    sizes: defaultdict[bytes, Counter[int]] = defaultdict(Counter)
    offset = _HEADER_LENGTH
    while offset < len(data):
        end = _end(data, offset)
        if end is not None and data[offset + 2] == _DATA:
            sizes[data[offset + 3 : offset + 5]][end - offset] += 1
        offset = offset + 1 if end is None else end
    return {topic: counts.most_common(1)[0][0] for topic, counts in sizes.items()}


def _is_unsound(text: bytes, recent_us: Collection[int]) -> bool:
    """Return whether a text is no UTF-8, or its time contradicts the samples written before it.

    The latest of them does not count: its time may be damaged.
    """
    try:
        text[_TEXT_TIME + _stamp.size :].decode()
    except UnicodeDecodeError:
        return True
    if len(text) < _TEXT_TIME + _stamp.size:
        return True
    if len(recent_us) < _EARLIER_SAMPLES:
        return False
    ahead_us = _stamp.unpack_from(text, _TEXT_TIME)[0] - sorted(recent_us)[-2]
    return not -_TEXT_BEHIND_US <= ahead_us <= _TEXT_AHEAD_US


def _is_parameter(body: bytes) -> bool:
    """Return whether the body of a message is a parameter: key length, key and value."""
    key = body[1 : len(body) - _PARAMETER_VALUE]
    return len(key) == body[0] and _PARAMETER_KEY.fullmatch(key) is not None


def _end(data: bytes, offset: int) -> int | None:
    """Return the end of the message that begins at an offset; None without a valid one."""
    if offset + _head.size > len(data):
        return None
    size, kind = _head.unpack_from(data, offset)
    begin = offset + _head.size
    end: int = begin + size
    if kind not in _TYPES or not 0 < size <= _MAX_MESSAGE_BYTES or end > len(data):
        return None
    if kind == _FORMAT and _NO_FORMAT.search(data, begin, end):
        return None
    if kind == _TEXT and data[begin] not in _LEVELS:
        return None
    if kind == _PARAMETER and not _is_parameter(data[begin:end]):
        return None
    return end


def _is_message_sequence(data: bytes, offset: int) -> bool:
    """Return True if _RESYNC_MESSAGES valid messages (or all up to the end) follow each other."""
    for _ in range(_RESYNC_MESSAGES):
        if offset == len(data):
            return True
        end = _end(data, offset)
        if end is None:
            return False
        offset = end
    return True


def _clear_appended_offsets(message: bytes) -> bytes:
    """Return a flags message without offsets of appended data, which is read in file order."""
    if message[2] != _FLAGS or len(message) < _head.size + _APPENDED:
        return message
    return message[: _head.size + _APPENDED] + bytes(len(message) - _head.size - _APPENDED)


class _Expansion(NamedTuple):
    """Size of a format in pyulog: it lists each element of each array by its full name."""

    fields: int
    """Number of elements."""
    name_bytes: int
    """Total length of their names."""


class _Field(NamedTuple):
    """Field of a format."""

    type: str
    length: int
    """Length of an array; 1 for a scalar."""
    name: str


_Formats = dict[str, list[list[_Field]]]
"""Fields of each format by name; a damaged file can define a name more than once."""


def refuse_large_formats(data: bytes) -> None:
    """Raise ValueError if the topics of a recovered file have more fields than the limits."""
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
    """Yield type and body of each message of an undamaged file."""
    offset = _HEADER_LENGTH
    while offset + _head.size <= len(data):
        size, kind = _head.unpack_from(data, offset)
        offset += _head.size
        yield kind, data[offset : offset + size]
        offset += size


def _parsed_fields(text: str) -> list[_Field]:
    """Return the fields of a format, each ``TYPE[COUNT] NAME;``, parsed as pyulog does."""
    fields = []
    for part in text.partition(":")[0].split(";"):
        kind, _, name = part.partition(" ")
        start = kind.find("[")
        count = kind[start + 1 : kind.find("]")] if start >= 0 else "1"
        try:
            # pyulog reads a count of 0 as one field and rejects counts above uint16.
            fields.append(_Field(kind.partition("[")[0], max(1, min(int(count), 0xFFFF)), name))
        except ValueError:
            continue
    return fields


def _expanded(name: str, formats: _Formats, known: dict[str, _Expansion], depth: int) -> _Expansion:
    """Return the largest size of the formats of a name; raise ValueError for deep nesting."""
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
    """Return the size of a list of fields."""
    number = name_bytes = 0
    for field in fields:
        scalar = field.type in _SCALAR_TYPES
        inner = _Expansion(1, 0) if scalar else _expanded(field.type, formats, known, depth + 1)
        number += field.length * inner.fields
        name_bytes += field.length * (inner.name_bytes + inner.fields * (len(field.name) + 8))
    return _Expansion(number, name_bytes)
