"""Reader of MCAP files from the first to the last record, with a check of every checksum.

Format: https://mcap.dev/spec. The content of a file is taken from its data section. The summary at
the end, which has its own checksum, is used to find what the data section has lost. The sizes that
a file declares are limited before memory is allocated for them.
"""

import struct
import zlib
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

import zstandard
from mcap.opcode import Opcode

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.logging.mcap import MAGIC

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_CHUNK_BYTES = 64_000_000
"""Maximum size of an unpacked chunk. Common writers close a chunk at 0.06 to 4 MB."""
MAX_EXPANSION = 100
"""Maximum ratio of all unpacked chunks to the file's size. Telemetry compresses 2 to 20 times."""
SMALL_FILE_UNPACKED_BYTES = 16_000_000
"""Addition to the limit of ``MAX_EXPANSION``, so that a short log of constant values is read."""
MAX_LISTED = 3
"""Maximum number of damaged places that ``format_damage`` lists."""

INDEXED_BYTES = 4_000_000
"""Size of unpacked chunks that a batched reader indexes together."""

_RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of the content."""
_MESSAGE_HEAD = struct.Struct("<HIQ8x")
"""Channel, sequence number, log time; the publish time is skipped."""
_CHUNK_HEAD = struct.Struct("<QQQI")
"""First and last log time, unpacked size, CRC-32 of the unpacked records."""
_CHUNK_INDEX_HEAD = struct.Struct("<QQQ")
"""First and last log time, position of the chunk."""
_STATISTICS_HEAD = struct.Struct("<QHIIIIQ")
"""Counts of messages, schemas, channels, attachments, metadata and chunks; first log time."""
_FOOTER = struct.Struct("<QQI")
"""Positions of summary and summary offsets, CRC-32 of the summary."""
_MESSAGE = int(Opcode.MESSAGE)
_DATA_END_BYTES = _RECORD_HEAD.size + 4
_FOOTER_BYTES = _RECORD_HEAD.size + _FOOTER.size


class McapError(InputError):
    """The file is not an MCAP file or unpacks to more than the limits; the text contains which."""

    code = ErrorCode.MCAP_CONTENT


class McapSchema(NamedTuple):
    """Description of a message."""

    number: int
    name: str
    encoding: str
    data: bytes


class McapChannel(NamedTuple):
    """A channel: topic and encoding of its messages."""

    number: int
    topic: str
    encoding: str
    schema: McapSchema | None


class McapMessage(NamedTuple):
    """One message."""

    channel: int
    """Number of the channel."""
    sequence: int
    time_ns: int
    """Log time: UNIX time, in nanoseconds."""
    data: bytes


class McapAttachment(NamedTuple):
    """A file inside the file."""

    time_ns: int
    """Log time: UNIX time, in nanoseconds."""
    name: str
    media_type: str
    data: bytes


class McapMetadata(NamedTuple):
    """A group of texts inside the file."""

    name: str
    values: dict[str, str]


class McapBatch(NamedTuple):
    """Messages of one channel in one or more chunks, in the order of the file."""

    channel: int
    """Number of the channel."""
    times_ns: "NDArray[np.int64]"
    """Log times: UNIX time, in nanoseconds."""
    lengths: "NDArray[np.int64]"
    """Length of each payload in bytes."""
    data: bytes
    """Payloads, one after the other."""


McapItem = McapChannel | McapMessage | McapBatch | McapAttachment | McapMetadata


class McapDamage(NamedTuple):
    """Damage at one place of the file, and the log times of the messages lost there."""

    reason: str
    first_ns: int | None = None
    last_ns: int | None = None


class _Chunk(NamedTuple):
    """Records of an unpacked chunk whose checksum is correct."""

    position: int
    """Position of the chunk in the file."""
    times: tuple[int, int]
    """First and last log time."""
    records: bytes


class _Summary(NamedTuple):
    """Content of the summary; empty if its checksum is absent or wrong."""

    places: dict[int, int]
    """Opcode of each indexed record by position: chunks, attachments, metadata, end of data."""
    chunk_times: dict[int, tuple[int, int]]
    """First and last log time of each chunk by position."""
    schemas: dict[int, McapSchema]
    channels: dict[int, bytes]
    """Content of the channel records by channel number."""
    counts: tuple[int, int, int] | None
    """Numbers of messages, attachments and metadata records."""
    start_ns: int | None
    """Log time of the earliest message."""


def _any_channel(_: McapChannel) -> bool:
    """Return True: the default of ``McapReader.wanted``."""
    return True


class McapReader:
    """Read an MCAP file once. Read ``damage`` when ``items`` is exhausted.

    Parameters
    ----------
    file : binary file
        Open file with random access; the caller closes it.
    wanted : callable
        Return whether the messages of a channel are read.
    batched : bool
        Whether to return the messages of many chunks by channel, which takes a fifth of the time.

    Raises
    ------
    McapError
        The file does not begin like an MCAP file.
    """

    def __init__(
        self,
        file: BinaryIO,
        wanted: Callable[[McapChannel], bool] = _any_channel,
        *,
        batched: bool = False,
    ) -> None:
        self.damage: list[McapDamage] = []
        """Damage in the file, in the order of detection."""
        self.finished = False
        """Whether the file ends with a footer, which ``McapWriter.finish`` writes."""
        self._file, self._is_wanted, self._batched = file, wanted, batched
        self._size = file.seek(0, 2)
        self._end = self._size
        self._summary = _Summary(
            places={}, chunk_times={}, schemas={}, channels={}, counts=None, start_ns=None
        )
        self._schemas: dict[int, McapSchema] = {}
        self._channels: dict[int, McapChannel] = {}
        self._wanted: dict[int, bool] = {}
        self._counts = [0, 0, 0]
        self._crc = 0
        self._unpacked_bytes = 0
        self._first_ns: int | None = None
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC:
            raise McapError("it does not begin with the MCAP magic bytes")
        self._read_ending()

    @property
    def start_ns(self) -> int:
        """Log time of the earliest message, or without a summary of the first message read; ns."""
        known = self._first_ns if self._summary.start_ns is None else self._summary.start_ns
        return known or 0

    def items(self) -> Iterator[McapItem]:
        """Read channels, messages, attachments and metadata in the order of the file.

        Yields
        ------
        McapChannel, McapMessage or McapBatch, McapAttachment, McapMetadata
            Each channel before its messages. Damaged parts are skipped and added to ``damage``.

        Raises
        ------
        McapError
            The chunks unpack to more than the limits.
        """
        pending, pending_bytes = list[_Chunk](), 0
        for position, opcode, content in self._records():
            if opcode == Opcode.MESSAGE_INDEX:
                continue
            if pending and (opcode != Opcode.CHUNK or pending_bytes >= INDEXED_BYTES):
                yield from self._items_by_channel(pending)
                pending, pending_bytes = [], 0
            try:
                if opcode == Opcode.CHUNK:
                    chunk = self._unpack_chunk(position, content)
                    if chunk and self._batched:
                        pending.append(chunk)
                        pending_bytes += len(chunk.records)
                    elif chunk:
                        yield from self._chunk_items(chunk)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                    record = _RECORD_HEAD.pack(opcode, len(content)) + content
                    items = self._inner_items(record)
                    yield from _by_channel(list(items)) if self._batched else items
                elif opcode == Opcode.ATTACHMENT:
                    self._counts[1] += 1
                    yield _attachment(content)
                elif opcode == Opcode.METADATA:
                    self._counts[2] += 1
                    yield _metadata(content)
                elif opcode == Opcode.DATA_END:
                    self._check_data_section(content)
            except McapError:
                raise
            except (struct.error, ValueError) as error:
                self._note(f"{Opcode(opcode).name.lower()} at byte {position}: {error}")
        yield from self._items_by_channel(pending)
        counts = self._summary.counts
        if not self.damage and counts is not None and counts != tuple(self._counts):
            self._note(f"holds {self._counts[0]} messages, its statistics say {counts[0]}")

    def _note(self, reason: str, times: tuple[int, int] | None = None) -> None:
        """Add damage, with the first and last log time of the lost messages if known."""
        first_ns, last_ns = times if times and times[0] <= times[1] else (None, None)
        self.damage.append(McapDamage(reason, first_ns, last_ns))

    def _read_ending(self) -> None:
        """Detect whether the file was finished; read its summary if the checksum is correct."""
        footer_at = self._size - len(MAGIC) - _FOOTER_BYTES
        if footer_at < len(MAGIC):
            return
        self._file.seek(footer_at)
        tail = self._file.read()
        head = _RECORD_HEAD.unpack_from(tail)
        if head != (Opcode.FOOTER, _FOOTER.size) or not tail.endswith(MAGIC):
            return
        self.finished, self._end = True, footer_at
        start, _, crc = _FOOTER.unpack_from(tail, _RECORD_HEAD.size)
        if start == 0 or crc == 0:
            return
        if start < len(MAGIC) + _DATA_END_BYTES or start > footer_at:
            self._note(f"its footer places the summary at byte {start}")
            return
        self._file.seek(start)
        summary = self._file.read(footer_at - start)
        if zlib.crc32(summary + tail[: _FOOTER_BYTES - 4]) != crc:
            self._note("the checksum of its summary is wrong")
            return
        try:
            self._summary = _read_summary(summary)
        except (struct.error, ValueError) as error:
            self._note(f"its summary: {error}")
            return
        self._end = start
        self._summary.places[start - _DATA_END_BYTES] = Opcode.DATA_END

    def _records(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield position, opcode and content of each record of the data section.

        After a broken record, continue at the next position in the summary.
        """
        places = self._summary.places
        ordered = sorted(place for place in places if place <= self._end)
        position, crc = len(MAGIC), zlib.crc32(MAGIC)
        self._file.seek(position)
        while position < self._end:
            index = bisect_right(ordered, position)
            following = ordered[index] if index < len(ordered) else self._end
            head = self._file.read(_RECORD_HEAD.size)
            opcode, length = _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (0, 0)
            end = position + _RECORD_HEAD.size + length
            if opcode == 0 or end > following or places.get(position, opcode) != opcode:
                self._note(
                    f"broken record at byte {position}", self._summary.chunk_times.get(position)
                )
                position = following
                self._file.seek(position)
                continue
            content = self._file.read(length)
            if opcode == Opcode.DATA_END:
                self._crc = crc
                yield position, opcode, content
                return
            crc = zlib.crc32(content, zlib.crc32(head, crc))
            yield position, opcode, content
            position = end
        if self.finished and not self.damage:
            self._note("its data section has no end record")

    def _check_data_section(self, content: bytes) -> None:
        """Compare the checksum of the data section, unless other damage explains a wrong one."""
        declared = int.from_bytes(content[:4], "little")
        if declared not in (0, self._crc) and not self.damage:
            self._note("the checksum of its data section is wrong, its chunks are whole")

    def _unpack_chunk(self, position: int, content: bytes) -> _Chunk | None:
        """Return the chunk at a position of the file; note its damage and return None."""
        first_ns, last_ns, size, crc = _CHUNK_HEAD.unpack_from(content)
        times = self._summary.chunk_times.get(position, (first_ns, last_ns))
        try:
            compression, start = _text(content, _CHUNK_HEAD.size)
            stored = content[start + 8 :]
            if len(stored) != int.from_bytes(content[start : start + 8], "little"):
                raise ValueError("its length is wrong")
            records = _decompress(stored, compression, size)
            self._count_unpacked(len(records))
            if crc not in (0, zlib.crc32(records)):
                raise ValueError("its checksum is wrong")
        except McapError:
            raise
        except (struct.error, ValueError) as error:
            self._note_chunk(position, times, error)
            return None
        return _Chunk(position, times, records)

    def _note_chunk(self, position: int, times: tuple[int, int], error: Exception) -> None:
        """Add damage of a chunk."""
        self._note(f"chunk at byte {position}: {error}", times)

    def _chunk_items(self, chunk: _Chunk) -> Iterator[McapItem]:
        """Yield the content of a chunk; note its damage."""
        try:
            yield from self._inner_items(chunk.records)
        except McapError:
            raise
        except (struct.error, ValueError) as error:
            self._note_chunk(chunk.position, chunk.times, error)

    def _items_by_channel(self, chunks: Sequence[_Chunk]) -> Iterator[McapItem]:
        """Yield the content of chunks: channels, then the messages of each channel."""
        # Imported here because it loads numba, which no other reader of logs needs.
        from mavlink_io.logging import mcap_index

        data = b"".join(chunk.records for chunk in chunks)
        ends = list(accumulate(len(chunk.records) for chunk in chunks))
        index = mcap_index.index_records(data, ends)
        try:
            if index is None:
                raise ValueError("a record in it reaches beyond its end")
            for opcode, start, stop in mcap_index.other_records(index):
                if channel := self._describe(opcode, data[start:stop]):
                    yield channel
            counts = mcap_index.message_counts(index)
            for number in counts:
                if number not in self._wanted:
                    yield self._channel_from_summary(number)
        except (struct.error, ValueError):
            # Read one by one: this notes the chunk that is damaged, and gives the others.
            for chunk in chunks:
                yield from _by_channel(list(self._chunk_items(chunk)))
            return
        self._counts[0] += sum(counts.values())
        for number in counts:
            if self._wanted[number]:
                times_ns, lengths, payloads = mcap_index.messages(data, index, number)
                yield McapBatch(number, times_ns, lengths, payloads)
        if counts and self._first_ns is None:
            self._first_ns = mcap_index.first_time_ns(index)

    def _count_unpacked(self, size: int) -> None:
        """Add the size of an unpacked chunk. Raises McapError above the limit."""
        self._unpacked_bytes += size
        limit = MAX_EXPANSION * self._size + SMALL_FILE_UNPACKED_BYTES
        if self._unpacked_bytes > limit:
            raise McapError(f"its {self._size} bytes unpack to more than {limit / 1e6:.0f} MB")

    def _inner_items(self, records: bytes) -> Iterator[McapItem]:
        """Yield the content of the records of a chunk, or of one record outside of chunks."""
        position, end, wanted = 0, len(records), self._wanted
        while position < end:
            opcode, length = _RECORD_HEAD.unpack_from(records, position)
            start, position = position + _RECORD_HEAD.size, position + _RECORD_HEAD.size + length
            if position > end:
                raise ValueError("a record in it reaches beyond its end")
            if opcode == _MESSAGE:
                if length < _MESSAGE_HEAD.size:
                    raise ValueError(f"a message in it is {length} bytes long")
                number, sequence, time_ns = _MESSAGE_HEAD.unpack_from(records, start)
                if number not in wanted:
                    yield self._channel_from_summary(number)
                self._counts[0] += 1
                if self._first_ns is None:
                    self._first_ns = time_ns
                if not wanted[number]:
                    continue
                data = records[start + _MESSAGE_HEAD.size : position]
                yield McapMessage(number, sequence, time_ns, data)
            elif new_channel := self._describe(opcode, records[start:position]):
                yield new_channel

    def _describe(self, opcode: int, content: bytes) -> McapChannel | None:
        """Store a schema or a channel; return a channel that is new. Raises ValueError."""
        if opcode == Opcode.SCHEMA:
            schema = _schema(content)
            self._schemas[schema.number] = schema
        elif opcode == Opcode.CHANNEL:
            channel = _channel(content, self._schemas)
            if channel.number not in self._channels:
                return self._register(channel)
            if channel != self._channels[channel.number]:
                raise ValueError(f"channel {channel.number} is described twice, differently")
        return None

    def _register(self, channel: McapChannel) -> McapChannel:
        """Store a channel and whether its messages are wanted."""
        self._channels[channel.number] = channel
        self._wanted[channel.number] = self._is_wanted(channel)
        return channel

    def _channel_from_summary(self, number: int) -> McapChannel:
        """Return a channel whose description was lost with a chunk. Raises ValueError."""
        if number not in self._summary.channels:
            raise ValueError(f"channel {number} is not described")
        schemas = self._summary.schemas | self._schemas
        return self._register(_channel(self._summary.channels[number], schemas))


def _by_channel(items: Sequence[McapItem]) -> Iterator[McapItem]:
    """Yield the items with the messages of each channel as one batch, at the end."""
    import numpy as np

    messages: dict[int, list[McapMessage]] = {}
    for item in items:
        if isinstance(item, McapMessage):
            messages.setdefault(item.channel, []).append(item)
        else:
            yield item
    for channel, of_channel in messages.items():
        yield McapBatch(
            channel=channel,
            times_ns=np.array([message.time_ns for message in of_channel], np.int64),
            lengths=np.array([len(message.data) for message in of_channel], np.int64),
            data=b"".join(message.data for message in of_channel),
        )


def format_damage(reader: McapReader) -> str:
    """Return one line with the damaged places of a file and the lost seconds of the log.

    Parameters
    ----------
    reader : McapReader
        Reader whose ``items`` are exhausted.

    Returns
    -------
    str
        The first ``MAX_LISTED`` places and the number of further ones.
    """
    texts = damage_texts(reader)
    more = [f"and {len(texts) - MAX_LISTED} more places"] if len(texts) > MAX_LISTED else []
    return "; ".join([*texts[:MAX_LISTED], *more])


def damage_texts(reader: McapReader) -> list[str]:
    """Return one text per damaged place of a file.

    Parameters
    ----------
    reader : McapReader
        Reader whose ``items`` are exhausted.

    Returns
    -------
    list of str
        Reasons, with the lost time in seconds from the log's first message.
    """
    return [_format_damage(damage, reader.start_ns) for damage in reader.damage]


def _format_damage(damage: McapDamage, start_ns: int) -> str:
    """Return the text of one damage."""
    if damage.first_ns is None or damage.last_ns is None:
        return damage.reason
    first_s, last_s = ((ns - start_ns) / 1e9 for ns in (damage.first_ns, damage.last_ns))
    return f"{damage.reason} ({first_s:.2f} to {last_s:.2f} s of the log are lost)"


def _decompress(stored: bytes, compression: str, size: int) -> bytes:
    """Return the records of a chunk; allocate at most ``size`` bytes. Raises ValueError."""
    if size > MAX_CHUNK_BYTES:
        limit = f"the limit is {MAX_CHUNK_BYTES / 1e6:.0f} MB"
        raise ValueError(f"it declares {size / 1e6:.0f} MB of unpacked records, {limit}")
    if compression == "zstd":
        records = _decompress_zstd(stored, size)
    elif compression == "lz4":
        records = _decompress_lz4(stored, size)
    elif compression == "":
        records = stored
    else:
        raise ValueError(f"its compression {compression!r} is neither zstd nor lz4")
    if len(records) != size:
        raise ValueError("it does not unpack to the size that it declares")
    return records


def _decompress_zstd(stored: bytes, size: int) -> bytes:
    """Return data unpacked with zstd. Raises ValueError."""
    # zstandard allocates the size that the frame declares despite max_output_size: check it first
    try:
        if zstandard.frame_content_size(stored) not in (-1, size):
            raise ValueError("it does not unpack to the size that it declares")
        unpacker = zstandard.ZstdDecompressor(max_window_size=2 * MAX_CHUNK_BYTES)
        return unpacker.decompress(stored, max_output_size=size)
    except zstandard.ZstdError:
        raise ValueError("its zstd data are broken") from None


def _decompress_lz4(stored: bytes, size: int) -> bytes:
    """Return data unpacked with lz4. Raises ValueError."""
    import lz4.frame

    try:
        records: bytes = lz4.frame.LZ4FrameDecompressor().decompress(stored, max_length=size + 1)
    except RuntimeError:
        raise ValueError("its lz4 data are broken") from None
    return records


def _read_summary(data: bytes) -> _Summary:
    """Return the content of a summary. Raises struct.error and ValueError."""
    summary = _Summary(
        places={}, chunk_times={}, schemas={}, channels={}, counts=None, start_ns=None
    )
    position = 0
    while position < len(data):
        opcode, length = _RECORD_HEAD.unpack_from(data, position)
        position += _RECORD_HEAD.size
        content = data[position : position + length]
        if len(content) != length:
            raise ValueError("a record in it reaches beyond its end")
        position += length
        match opcode:
            case Opcode.SCHEMA:
                schema = _schema(content)
                summary.schemas[schema.number] = schema
            case Opcode.CHANNEL:
                summary.channels[int.from_bytes(content[:2], "little")] = content
            case Opcode.CHUNK_INDEX:
                first_ns, last_ns, place = _CHUNK_INDEX_HEAD.unpack_from(content)
                summary.places[place] = Opcode.CHUNK
                summary.chunk_times[place] = first_ns, last_ns
            case Opcode.ATTACHMENT_INDEX:
                summary.places[int.from_bytes(content[:8], "little")] = Opcode.ATTACHMENT
            case Opcode.METADATA_INDEX:
                summary.places[int.from_bytes(content[:8], "little")] = Opcode.METADATA
            case Opcode.STATISTICS:
                numbers = _STATISTICS_HEAD.unpack_from(content)
                counts = numbers[0], numbers[3], numbers[4]
                summary = summary._replace(counts=counts, start_ns=numbers[6])
    return summary


def _schema(content: bytes) -> McapSchema:
    """Return the content of a schema record."""
    (number,) = struct.unpack_from("<H", content)
    name, position = _text(content, 2)
    encoding, position = _text(content, position)
    data, _ = _blob(content, position)
    return McapSchema(number=number, name=name, encoding=encoding, data=data)


def _channel(content: bytes, schemas: dict[int, McapSchema]) -> McapChannel:
    """Return the content of a channel record. Raises ValueError."""
    number, schema = struct.unpack_from("<HH", content)
    topic, position = _text(content, 4)
    encoding, _ = _text(content, position)
    if schema and schema not in schemas:
        raise ValueError(f"schema {schema} of {topic} is not described")
    return McapChannel(
        number=number, topic=topic, encoding=encoding, schema=schemas[schema] if schema else None
    )


def _attachment(content: bytes) -> McapAttachment:
    """Return the content of an attachment record. Raises ValueError."""
    (time_ns,) = struct.unpack_from("<Q", content)
    name, position = _text(content, 16)
    media_type, position = _text(content, position)
    (length,) = struct.unpack_from("<Q", content, position)
    data = content[position + 8 : position + 8 + length]
    (crc,) = struct.unpack_from("<I", content, position + 8 + len(data))
    if len(data) != length or crc not in (0, zlib.crc32(content[:-4])):
        raise ValueError("its checksum is wrong")
    return McapAttachment(time_ns=time_ns, name=name, media_type=media_type, data=data)


def _metadata(content: bytes) -> McapMetadata:
    """Return the content of a metadata record."""
    name, position = _text(content, 0)
    entries, _ = _blob(content, position)
    values, position = {}, 0
    while position < len(entries):
        key, position = _text(entries, position)
        values[key], position = _text(entries, position)
    return McapMetadata(name, values)


def _text(data: bytes, position: int) -> tuple[str, int]:
    """Return a text that follows its length, and the position after it. Raises ValueError."""
    blob, end = _blob(data, position)
    try:
        return blob.decode(), end
    except UnicodeDecodeError:
        raise ValueError("a text in it is no UTF-8") from None


def _blob(data: bytes, position: int) -> tuple[bytes, int]:
    """Return data that follow their length, and the position after them. Raises ValueError."""
    (length,) = struct.unpack_from("<I", data, position)
    end = position + 4 + length
    if end > len(data):
        raise ValueError("a length in it reaches beyond its end")
    return data[position + 4 : end], end
