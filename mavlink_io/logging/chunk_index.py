"""Index of the chunks of an MCAP file that is being written, compressed in memory."""

import struct
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import zstandard

BLOCK_CHUNKS = 256
"""Number of chunks that are compressed together."""
_COMPRESSION_LEVEL = 1
_MODULUS_MASK = 2**64 - 1
"""Differences are stored modulo 2^64, in which all numbers of the format are."""
_FIXED_NUMBERS = 8
"""Number of numbers of a chunk in a block, without those of its channels."""


class Chunk(NamedTuple):
    """Index entry of a chunk."""

    first_ns: int
    last_ns: int
    """Log times of the first and the last message."""
    start: int
    """Position of the chunk record in the file."""
    length: int
    """Length of the chunk record."""
    index_starts: dict[int, int]
    """Position of the message index record of each channel, in ascending order."""
    index_length: int
    """Length of all message index records, which follow the chunk record."""
    stored_bytes: int
    """Size of the compressed records."""
    bytes: int
    """Size of the uncompressed records."""


class ChunkIndex:
    """Index entries of all chunks of a file.

    The log of an armed vehicle gets five chunks a second, for days. Compressed differences between
    neighbouring entries take 4 MB a day in place of 450 MB: most of them are equal.
    """

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._newest: list[Chunk] = []
        self._compress = zstandard.ZstdCompressor(level=_COMPRESSION_LEVEL).compress

    def __len__(self) -> int:
        """Return the number of chunks."""
        return BLOCK_CHUNKS * len(self._blocks) + len(self._newest)

    def add(self, chunk: Chunk) -> None:
        """Add the entry of the next chunk of the file.

        Parameters
        ----------
        chunk : Chunk
            The entry.
        """
        self._newest.append(chunk)
        if len(self._newest) == BLOCK_CHUNKS:
            packed = self._compress(_pack(self._newest))
            self._blocks.append(bytes(memoryview(packed)))  # the original fills its first buffer
            self._newest = []

    def blocks(self) -> Iterator[Sequence[Chunk]]:
        """Return all entries in the order of the file, some at a time.

        Returns
        -------
        iterator of sequence of Chunk
            At most ``BLOCK_CHUNKS`` entries each.
        """
        decompress = zstandard.ZstdDecompressor().decompress
        for block in self._blocks:
            yield tuple(_unpack(decompress(block)))
        yield self._newest


def _pack(chunks: Sequence[Chunk]) -> bytes:
    """Return the entries as differences of neighbouring times and positions."""
    numbers: list[int] = []
    time_ns = position = 0
    for chunk in chunks:
        numbers += (
            chunk.first_ns - time_ns,
            chunk.last_ns - chunk.first_ns,
            chunk.start - position,
            chunk.length,
            chunk.index_length,
            chunk.length - chunk.stored_bytes,
            chunk.bytes,
            len(chunk.index_starts),
        )
        time_ns, position = chunk.last_ns, chunk.start + chunk.length
        for channel, start in chunk.index_starts.items():
            numbers += channel, start - position
            position = start
    return struct.pack(f"<{len(numbers)}Q", *(number & _MODULUS_MASK for number in numbers))


def _unpack(data: bytes) -> Iterator[Chunk]:
    """Return the entries of ``_pack``."""
    numbers = iter(struct.unpack(f"<{len(data) // 8}Q", data))
    time_ns = position = 0
    while fixed := tuple(islice(numbers, _FIXED_NUMBERS)):
        wait_ns, duration_ns, gap, length, index_length, overhead, size, channels = fixed
        first_ns = time_ns + wait_ns & _MODULUS_MASK
        time_ns = first_ns + duration_ns & _MODULUS_MASK
        start = position + gap & _MODULUS_MASK
        position, index_starts = start + length, {}
        for _ in range(channels):
            channel = next(numbers)
            position = position + next(numbers) & _MODULUS_MASK
            index_starts[channel] = position
        yield Chunk(
            first_ns=first_ns,
            last_ns=time_ns,
            start=start,
            length=length,
            index_starts=index_starts,
            index_length=index_length,
            stored_bytes=length - overhead & _MODULUS_MASK,
            bytes=size,
        )
