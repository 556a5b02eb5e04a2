"""The messages of some channels of an MCAP file, chunk by chunk.

The mcap library makes an object of every record field by field; a log holds a hundred messages a
second, of which identification wants some, and here the others are stepped over."""

import struct
from collections.abc import Container, Iterator
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, ChunkIndex
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary

_HEAD = struct.Struct("<BQ")
"""Of every record: kind and length."""
_MESSAGE = struct.Struct("<H4xQ8x")
"""Channel and log time; sequence number and publish time stand between and behind."""


class Message(NamedTuple):
    channel: int
    time_ns: int
    """Log time."""
    data: bytes


def messages(stream: IO[bytes], summary: Summary, wanted: Container[int]) -> Iterator[Message]:
    """Those of the channels ``wanted``, by number, as they stand in the file. Raises McapError."""
    if not summary.chunk_indexes:
        yield from _read_unindexed(stream, wanted)
    for index in summary.chunk_indexes:
        yield from _select_messages(_records(stream, index), wanted)


def _records(stream: IO[bytes], index: ChunkIndex) -> bytes:
    """A chunk's records, unpacked."""
    stream.seek(index.chunk_start_offset + _HEAD.size)
    records, length = get_chunk_data_stream(Chunk.read(ReadDataStream(stream)))
    return records.read(length)


def _select_messages(records: bytes, wanted: Container[int]) -> Iterator[Message]:
    at, end = 0, len(records)
    try:
        while at < end:
            kind, length = _HEAD.unpack_from(records, at)
            at += _HEAD.size
            if kind == Opcode.MESSAGE:
                channel, time_ns = _MESSAGE.unpack_from(records, at)
                if channel in wanted:
                    yield Message(channel, time_ns, records[at + _MESSAGE.size : at + length])
            at += length
    except struct.error:
        raise EndOfFile from None


def _read_unindexed(stream: IO[bytes], wanted: Container[int]) -> Iterator[Message]:
    """Of a file whose writer kept no index."""
    stream.seek(0)
    for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
        if channel.id in wanted:
            yield Message(channel.id, message.log_time, message.data)
