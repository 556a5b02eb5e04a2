"""Writer of MCAP files: chunks of messages, attachments, and an index at the end.

Format: https://mcap.dev/spec. For programs with deadlines: adding a message only copies it;
compression and file access are done per chunk, by another thread if there is one. A file that was
not finished can be read up to its last complete chunk.
"""

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Protocol

import zstandard

from mavlink_io.logging.chunk_index import Chunk, ChunkIndex

CHUNK_BYTES = 60_000
"""Size at which a chunk is closed, in bytes; the last message may exceed it."""
MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of a file."""
COMPRESSION_LEVEL = 1
"""Compression level of zstd: the fastest normal level."""
_NO_TIME_NS = 2**64 - 1
"""Greatest log time of the format."""

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
"""``struct`` formats of a message head: prefix, sequence number, log time and publish time.

The prefix comes from ``message_prefix``."""


class Sink(Protocol):
    """A binary file, or an object with the same methods."""

    def write(self, data: bytes, /) -> object:
        """Write all bytes."""
        ...

    def flush(self) -> None:
        """Pass all written bytes to the operating system."""
        ...


Scheduler = Callable[[Callable[[], None]], None]
"""Run a function now, or later in the order of the calls."""


def run_immediately(work: Callable[[], None]) -> None:
    """Run a function now: the scheduler of a program with one thread."""
    work()


class Rows:
    """Messages of several channels that are always written together and have one index entry.

    Parameters
    ----------
    spots : sequence of (int, int)
        Channel number and offset in the row, in bytes, of each message.
    """

    def __init__(self, spots: Sequence[tuple[int, int]]) -> None:
        self.spots = tuple(spots)
        self.written: list[tuple[int, int]] = []
        """Log time (ns) and offset in the open chunk (bytes) of each row in this chunk."""


_WrittenRows = tuple[Sequence[tuple[int, int]], Sequence[tuple[int, int]]]
"""``Rows.spots`` and ``Rows.written``."""


def message_prefix(channel: int, payload_bytes: int) -> bytes:
    """Return the first 11 bytes of every message record of a channel with payloads of one length.

    Parameters
    ----------
    channel : int
        Number of the channel.
    payload_bytes : int
        Length of each payload.

    Returns
    -------
    bytes
        Opcode, record length and channel number.
    """
    return struct.pack(
        "<BQH", _MESSAGE, _message_head.size - _record_head.size + payload_bytes, channel
    )


class McapWriter:
    """An MCAP file that is being written.

    Schemas and channels are numbered from 1 in the order of their registration.

    Parameters
    ----------
    file : Sink
        The file; only the functions passed to ``later`` use it.
    profile : str
        MCAP profile of the file.
    library : str
        Name of the writing program.
    later : Scheduler
        Run a function that compresses or writes.
    """

    def __init__(
        self, file: Sink, profile: str, library: str, later: Scheduler = run_immediately
    ) -> None:
        self._file, self._later = file, later
        self._position = 0
        self._crc = 0
        """CRC-32 of all written bytes; at the end of the data section it is its checksum."""
        self._compress = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL).compress
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._parts: list[bytes] = []
        self._size = 0
        self._spots: dict[int, list[int]] = {}
        self._rows: list[Rows] = []
        self._chunks = ChunkIndex()
        self._first_ns, self._last_ns = _NO_TIME_NS, 0
        """Least and greatest log time of all messages."""
        self._counts: dict[int, int] = {}
        self._attachments: list[bytes] = []
        self._metadata: list[bytes] = []
        later(partial(self._put, MAGIC + _record(_HEADER, _text(profile) + _text(library))))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Register the schema of a message.

        Parameters
        ----------
        name : str
            Name of the schema.
        encoding : str
            Encoding of the schema, such as "ros1msg" or "jsonschema".
        data : bytes
            The schema.

        Returns
        -------
        int
            Number of the schema.
        """
        number = len(self._schemas) + 1
        content = struct.pack("<H", number) + _text(name) + _text(encoding) + _blob(data)
        self._schemas.append(_record(_SCHEMA, content))
        self._add(self._schemas[-1])
        return number

    def register_channel(self, topic: str, encoding: str, schema: int) -> int:
        """Open a channel.

        Parameters
        ----------
        topic : str
            Name of the channel.
        encoding : str
            Encoding of its messages, such as "ros1" or "json".
        schema : int
            Number of the schema.

        Returns
        -------
        int
            Number of the channel.
        """
        number = len(self._channels) + 1
        content = struct.pack("<HH", number, schema) + _text(topic) + _text(encoding) + _blob(b"")
        self._channels.append(_record(_CHANNEL, content))
        self._add(self._channels[-1])
        self._spots[number] = []
        return number

    def open_rows(self, spots: Sequence[tuple[int, int]]) -> Rows:
        """Prepare messages that are always written together.

        Parameters
        ----------
        spots : sequence of (int, int)
            Channel number and offset in the row, in bytes, of each message.

        Returns
        -------
        Rows
            For ``add_row``.
        """
        rows = Rows(spots)
        self._rows.append(rows)
        return rows

    def add_message(self, channel: int, time_ns: int, data: bytes, sequence: int) -> None:
        """Write one message.

        Parameters
        ----------
        channel : int
            Number of the channel.
        time_ns : int
            Log time and publish time: UNIX time, in nanoseconds.
        data : bytes
            The message.
        sequence : int
            Sequence number of the message.
        """
        self._spots[channel] += (time_ns, self._size)
        self._add(
            _message_head.pack(_MESSAGE, 22 + len(data), channel, sequence, time_ns, time_ns) + data
        )
        if self._size >= CHUNK_BYTES:
            self._close_chunk()

    def add_row(self, rows: Rows, time_ns: int, records: bytes) -> None:
        """Write one row.

        Parameters
        ----------
        rows : Rows
            Channels and offsets of the messages.
        time_ns : int
            Log time: UNIX time, in nanoseconds.
        records : bytes
            Message records with their heads, one for each spot.
        """
        rows.written.append((time_ns, self._size))
        self._add(records)
        if self._size >= CHUNK_BYTES:
            self._close_chunk()

    def add_attachment(self, time_ns: int, name: str, media_type: str, data: bytes) -> None:
        """Store a file inside the file.

        Parameters
        ----------
        time_ns : int
            Log time: UNIX time, in nanoseconds.
        name, media_type : str
            Name and media type of the file.
        data : bytes
            Content of the file.
        """
        self._close_chunk()
        self._later(partial(self._store_attachment, time_ns, name, media_type, data))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Store texts inside the file.

        Parameters
        ----------
        name : str
            Name of the group of texts.
        values : mapping of str to str
            Texts by name.
        """
        self._close_chunk()
        self._later(partial(self._store_metadata, name, dict(values)))

    def flush(self) -> None:
        """Close the open chunk, and pass all written bytes to the operating system."""
        self._close_chunk()
        self._later(self._file.flush)

    def finish(self) -> None:
        """Write statistics, indices and footer; nothing may be added afterwards."""
        self._close_chunk()
        self._later(self._store_summary)

    def _add(self, data: bytes) -> None:
        """Append a record to the open chunk."""
        self._parts.append(data)
        self._size += len(data)

    def _close_chunk(self) -> None:
        """Schedule the storage of the open chunk, and open an empty one."""
        if not self._parts:
            return
        written_rows = []
        for rows in self._rows:
            written_rows.append((rows.spots, rows.written))
            rows.written = []
        self._later(partial(self._store_chunk, self._parts, self._spots, written_rows))
        self._parts, self._size = [], 0
        self._spots = {channel: [] for channel in self._spots}

    def _store_chunk(
        self, parts: list[bytes], spots: dict[int, list[int]], rows: Iterable[_WrittenRows]
    ) -> None:
        """Compress and write a chunk and the index of its messages."""
        records, entries = b"".join(parts), _entries(spots, rows)
        times = [time_ns for numbers in entries.values() for time_ns in numbers[::2]] or [0]
        stored = self._compress(records)
        content = struct.pack("<QQQI", min(times), max(times), len(records), zlib.crc32(records))
        chunk = _record(_CHUNK, content + _text("zstd") + struct.pack("<Q", len(stored)) + stored)
        start, index, index_starts = self._position, b"", {}
        for channel, numbers in entries.items():
            index_starts[channel] = start + len(chunk) + len(index)
            packed = struct.pack(f"<{len(numbers)}Q", *numbers)
            index += _record(_MESSAGE_INDEX, struct.pack("<H", channel) + _blob(packed))
            self._counts[channel] = self._counts.get(channel, 0) + len(numbers) // 2
        self._put(chunk + index)
        if entries:
            self._first_ns = min(self._first_ns, *times)
            self._last_ns = max(self._last_ns, *times)
        self._chunks.add(
            Chunk(
                first_ns=min(times),
                last_ns=max(times),
                start=start,
                length=len(chunk),
                index_starts=index_starts,
                index_length=len(index),
                stored_bytes=len(stored),
                bytes=len(records),
            )
        )

    def _store_attachment(self, time_ns: int, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        head = struct.pack("<QQ", time_ns, time_ns) + _text(name) + _text(media_type)
        content = head + struct.pack("<Q", len(data)) + data
        record = _record(_ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))
        location = struct.pack("<QQQQQ", self._position, len(record), time_ns, time_ns, len(data))
        self._attachments.append(
            _record(_ATTACHMENT_INDEX, location + _text(name) + _text(media_type))
        )
        self._put(record)

    def _store_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record."""
        entries = b"".join(_text(key) + _text(value) for key, value in values.items())
        record = _record(_METADATA, _text(name) + _blob(entries))
        location = struct.pack("<QQ", self._position, len(record))
        self._metadata.append(_record(_METADATA_INDEX, location + _text(name)))
        self._put(record)

    def _store_summary(self) -> None:
        """Write the end of the data section, the summary and the footer."""
        self._put(_record(_DATA_END, struct.pack("<I", self._crc)))
        start, crc, offsets = self._position, 0, b""
        for opcode, parts in self._summary():
            group_start = self._position
            for part in parts:
                crc = zlib.crc32(part, crc)
                self._put(part)
            if length := self._position - group_start:
                location = struct.pack("<BQQ", opcode, group_start, length)
                offsets += _record(_SUMMARY_OFFSET, location)
        tail = _record_head.pack(_FOOTER, 20) + struct.pack("<QQ", start, self._position)
        crc = zlib.crc32(offsets + tail, crc)
        self._put(offsets + tail + struct.pack("<I", crc) + MAGIC)
        self._file.flush()

    def _put(self, data: bytes) -> None:
        """Write bytes to the file and add them to the checksum."""
        self._file.write(data)
        self._position += len(data)
        self._crc = zlib.crc32(data, self._crc)

    def _summary(self) -> Iterator[tuple[int, Iterable[bytes]]]:
        """Return opcode and content of each group of the summary; the content in parts."""
        yield _SCHEMA, self._schemas
        yield _CHANNEL, self._channels
        yield _STATISTICS, [self._statistics()]
        yield (
            _CHUNK_INDEX,
            (
                b"".join(_record(_CHUNK_INDEX, _chunk_index(chunk)) for chunk in block)
                for block in self._chunks.blocks()
            ),
        )
        yield _ATTACHMENT_INDEX, self._attachments
        yield _METADATA_INDEX, self._metadata

    def _statistics(self) -> bytes:
        """Return the statistics record: counts, and the first and last log time."""
        record_counts = (
            len(self._schemas),
            len(self._channels),
            len(self._attachments),
            len(self._metadata),
            len(self._chunks),
        )
        content = struct.pack(
            "<QHIIIIQQ",
            sum(self._counts.values()),
            *record_counts,
            self._first_ns if self._counts else 0,
            self._last_ns,
        )
        counts = b"".join(
            struct.pack("<HQ", channel, count) for channel, count in sorted(self._counts.items())
        )
        return _record(_STATISTICS, content + _blob(counts))


def _entries(spots: dict[int, list[int]], rows: Iterable[_WrittenRows]) -> dict[int, list[int]]:
    """Return alternating log times and offsets of all messages of a chunk, by channel."""
    for row_spots, written in rows:
        for channel, offset in row_spots:
            spots[channel] += [
                number for time_ns, start in written for number in (time_ns, start + offset)
            ]
    return {channel: numbers for channel, numbers in spots.items() if numbers}


def _chunk_index(chunk: Chunk) -> bytes:
    """Return the content of a chunk index record."""
    starts = b"".join(
        struct.pack("<HQ", channel, start) for channel, start in chunk.index_starts.items()
    )
    location = struct.pack("<QQQQ", chunk.first_ns, chunk.last_ns, chunk.start, chunk.length)
    sizes = struct.pack("<QQ", chunk.stored_bytes, chunk.bytes)
    return location + _blob(starts) + struct.pack("<Q", chunk.index_length) + _text("zstd") + sizes


def _record(opcode: int, content: bytes) -> bytes:
    """Return a record."""
    return _record_head.pack(opcode, len(content)) + content


def _blob(data: bytes) -> bytes:
    """Return data after their length."""
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    """Return a text in UTF-8 after its length."""
    return _blob(text.encode())
