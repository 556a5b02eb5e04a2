"""Writes MCAP files, https://mcap.dev/spec: chunks of messages, attachments, and at the end an
index of them all.

Made for a writer that must not be late: adding a message copies it, and all that a chunk needs
besides is worked out when the chunk is closed, by another thread where there is one. A file that
was never finished can be read up to its last whole chunk."""

import struct
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple, Protocol

import zstandard

CHUNK_BYTES = 60_000
"""A chunk is closed at this size or a little beyond."""
MAGIC = b"\x89MCAP0\r\n"
COMPRESSION_LEVEL = 1

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = range(1, 9)
(
    _ATTACHMENT,
    _ATTACHMENT_INDEX,
    _STATISTICS,
    _METADATA,
    _METADATA_INDEX,
    _SUMMARY_OFFSET,
    _DATA_END,
) = range(9, 16)
_record_head = struct.Struct("<BQ")
_message_head = struct.Struct("<BQHIQQ")
MESSAGE_HEAD_FORMAT = "11sIQQ"
"""A message's head after what ``message_prefix`` makes of its channel: sequence, log time, publish
time."""


class Sink(Protocol):
    """Where the bytes go: a file, or what stands for one."""

    def write(self, data: bytes, /) -> object: ...

    def flush(self) -> None: ...


Scheduler = Callable[[Callable[[], None]], None]
"""Does some work now, or later and in order."""


def run_immediately(work: Callable[[], None]) -> None:
    work()


class Rows:
    """Messages of several channels that are always written together, and so share one note of when
    and where."""

    def __init__(self, spots: Sequence[tuple[int, int]]) -> None:
        self.spots = tuple(spots)
        """Channel of each message, and how far into the row it begins."""
        self.written: list[tuple[int, int]] = []
        """Log time and place in the chunk of each row since the chunk was opened."""


_Written = tuple[Sequence[tuple[int, int]], Sequence[tuple[int, int]]]
"""The spots of a row, and log time and place of each row of that kind."""


class _Chunk(NamedTuple):
    """What the index at the end tells of a chunk."""

    first_ns: int
    last_ns: int
    start: int
    length: int
    index_starts: dict[int, int]
    index_length: int
    stored_bytes: int
    bytes: int


def message_prefix(channel: int, payload_bytes: int) -> bytes:
    """The first 11 bytes of every message record of a channel whose payloads have one length."""
    return struct.pack(
        "<BQH", _MESSAGE, _message_head.size - _record_head.size + payload_bytes, channel
    )


class McapWriter:
    """An MCAP file under way. Numbers schemas and channels from 1, in the order in which they are
    registered."""

    def __init__(
        self, file: Sink, profile: str, library: str, later: Scheduler = run_immediately
    ) -> None:
        """``later`` is given all work that compresses or writes; the file is used by nothing
        else."""
        self._file, self._later = file, later
        self._at = 0
        self._compress = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL).compress
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._parts: list[bytes] = []
        self._size = 0
        self._spots: dict[int, list[int]] = {}
        self._rows: list[Rows] = []
        self._chunks: list[_Chunk] = []
        self._counts: dict[int, int] = {}
        self._attachments: list[bytes] = []
        self._metadata: list[bytes] = []
        later(partial(self._put, MAGIC + _record(_HEADER, _text(profile) + _text(library))))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Describe a message; returns the number that channels refer to."""
        number = len(self._schemas) + 1
        content = struct.pack("<H", number) + _text(name) + _text(encoding) + _blob(data)
        self._schemas.append(_record(_SCHEMA, content))
        self._add(self._schemas[-1])
        return number

    def register_channel(self, topic: str, encoding: str, schema: int) -> int:
        """Open a channel; returns the number that messages refer to."""
        number = len(self._channels) + 1
        content = struct.pack("<HH", number, schema) + _text(topic) + _text(encoding) + _blob(b"")
        self._channels.append(_record(_CHANNEL, content))
        self._add(self._channels[-1])
        self._spots[number] = []
        return number

    def open_rows(self, spots: Sequence[tuple[int, int]]) -> Rows:
        """Announce messages that will be written together: the channel of each and its place in the
        row."""
        rows = Rows(spots)
        self._rows.append(rows)
        return rows

    def add_message(self, channel: int, time_ns: int, data: bytes, sequence: int) -> None:
        """Write one message; ``time_ns`` is its log time and its publish time."""
        self._spots[channel] += (time_ns, self._size)
        self._add(
            _message_head.pack(_MESSAGE, 22 + len(data), channel, sequence, time_ns, time_ns) + data
        )
        if self._size >= CHUNK_BYTES:
            self._close_chunk()

    def add_row(self, rows: Rows, time_ns: int, records: bytes) -> None:
        """Write whole message records, one for each of the row's spots."""
        rows.written.append((time_ns, self._size))
        self._add(records)
        if self._size >= CHUNK_BYTES:
            self._close_chunk()

    def add_attachment(self, time_ns: int, name: str, media_type: str, data: bytes) -> None:
        """Keep a file inside the file."""
        self._close_chunk()
        self._later(partial(self._store_attachment, time_ns, name, media_type, data))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Keep named texts inside the file."""
        self._close_chunk()
        self._later(partial(self._store_metadata, name, dict(values)))

    def flush(self) -> None:
        """Close the open chunk and hand everything on."""
        self._close_chunk()
        self._later(self._file.flush)

    def finish(self) -> None:
        """Write what makes the file whole: statistics, indices, footer. Nothing may be added
        afterwards."""
        self._close_chunk()
        self._later(self._store_summary)

    def _add(self, data: bytes) -> None:
        self._parts.append(data)
        self._size += len(data)

    def _close_chunk(self) -> None:
        """Leave the open chunk to be stored, and open an empty one."""
        if not self._parts:
            return
        rows = []
        for each in self._rows:
            rows.append((each.spots, each.written))
            each.written = []
        self._later(partial(self._store_chunk, self._parts, self._spots, rows))
        self._parts, self._size = [], 0
        self._spots = {channel: [] for channel in self._spots}

    def _store_chunk(
        self, parts: list[bytes], spots: dict[int, list[int]], rows: Iterable[_Written]
    ) -> None:
        records, entries = b"".join(parts), _entries(spots, rows)
        times = [time_ns for numbers in entries.values() for time_ns in numbers[::2]] or [0]
        stored = self._compress(records)
        content = struct.pack("<QQQI", min(times), max(times), len(records), zlib.crc32(records))
        chunk = _record(_CHUNK, content + _text("zstd") + struct.pack("<Q", len(stored)) + stored)
        start, index, index_starts = self._at, b"", {}
        for channel, numbers in entries.items():
            index_starts[channel] = start + len(chunk) + len(index)
            packed = struct.pack(f"<{len(numbers)}Q", *numbers)
            index += _record(_MESSAGE_INDEX, struct.pack("<H", channel) + _blob(packed))
            self._counts[channel] = self._counts.get(channel, 0) + len(numbers) // 2
        self._put(chunk + index)
        self._chunks.append(
            _Chunk(
                min(times),
                max(times),
                start,
                len(chunk),
                index_starts,
                len(index),
                len(stored),
                len(records),
            )
        )

    def _store_attachment(self, time_ns: int, name: str, media_type: str, data: bytes) -> None:
        head = struct.pack("<QQ", time_ns, time_ns) + _text(name) + _text(media_type)
        content = head + struct.pack("<Q", len(data)) + data
        record = _record(_ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))
        place = struct.pack("<QQQQQ", self._at, len(record), time_ns, time_ns, len(data))
        self._attachments.append(
            _record(_ATTACHMENT_INDEX, place + _text(name) + _text(media_type))
        )
        self._put(record)

    def _store_metadata(self, name: str, values: Mapping[str, str]) -> None:
        entries = b"".join(_text(key) + _text(value) for key, value in values.items())
        record = _record(_METADATA, _text(name) + _blob(entries))
        place = struct.pack("<QQ", self._at, len(record))
        self._metadata.append(_record(_METADATA_INDEX, place + _text(name)))
        self._put(record)

    def _store_summary(self) -> None:
        self._put(_record(_DATA_END, struct.pack("<I", 0)))
        start = self._at
        summary, offsets = self._summary(start)
        tail = _record_head.pack(_FOOTER, 20) + struct.pack("<QQ", start, start + len(summary))
        crc = zlib.crc32(summary + offsets + tail)
        self._put(summary + offsets + tail + struct.pack("<I", crc) + MAGIC)
        self._file.flush()

    def _put(self, data: bytes) -> None:
        self._file.write(data)
        self._at += len(data)

    def _summary(self, start: int) -> tuple[bytes, bytes]:
        """The groups of the summary, and the table of where each of them stands."""
        groups = {
            _SCHEMA: self._schemas,
            _CHANNEL: self._channels,
            _STATISTICS: [self._statistics()],
            _CHUNK_INDEX: [_record(_CHUNK_INDEX, _chunk_index(chunk)) for chunk in self._chunks],
            _ATTACHMENT_INDEX: self._attachments,
            _METADATA_INDEX: self._metadata,
        }
        summary, offsets = b"", b""
        for opcode, records in groups.items():
            group = b"".join(records)
            if group:
                offsets += _record(
                    _SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start + len(summary), len(group))
                )
                summary += group
        return summary, offsets

    def _statistics(self) -> bytes:
        busy = [chunk for chunk in self._chunks if chunk.index_starts]
        first_ns = min((chunk.first_ns for chunk in busy), default=0)
        last_ns = max((chunk.last_ns for chunk in busy), default=0)
        kinds = (
            len(self._schemas),
            len(self._channels),
            len(self._attachments),
            len(self._metadata),
            len(self._chunks),
        )
        content = struct.pack("<QHIIIIQQ", sum(self._counts.values()), *kinds, first_ns, last_ns)
        counts = b"".join(
            struct.pack("<HQ", channel, count) for channel, count in sorted(self._counts.items())
        )
        return _record(_STATISTICS, content + _blob(counts))


def _entries(spots: dict[int, list[int]], rows: Iterable[_Written]) -> dict[int, list[int]]:
    """Log time and place of every message of a chunk, in turn, by channel."""
    for columns, written in rows:
        for channel, offset in columns:
            spots[channel] += [
                number for time_ns, at in written for number in (time_ns, at + offset)
            ]
    return {channel: numbers for channel, numbers in spots.items() if numbers}


def _chunk_index(chunk: _Chunk) -> bytes:
    starts = b"".join(
        struct.pack("<HQ", channel, start) for channel, start in chunk.index_starts.items()
    )
    place = struct.pack("<QQQQ", chunk.first_ns, chunk.last_ns, chunk.start, chunk.length)
    sizes = struct.pack("<QQ", chunk.stored_bytes, chunk.bytes)
    return place + _blob(starts) + struct.pack("<Q", chunk.index_length) + _text("zstd") + sizes


def _record(opcode: int, content: bytes) -> bytes:
    return _record_head.pack(opcode, len(content)) + content


def _blob(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    return _blob(text.encode())
