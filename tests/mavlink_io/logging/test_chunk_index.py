"""Index of chunks: every entry is given back, and a day of a log fits in a few megabytes."""

import io
import tracemalloc

from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from mavlink_io.logging import chunk_index
from mavlink_io.logging.chunk_index import BLOCK_CHUNKS, Chunk, ChunkIndex
from mavlink_io.logging.mcap import McapWriter

UINT64 = st.integers(0, 2**64 - 1)
CHUNK = st.builds(
    Chunk,
    first_ns=UINT64,
    last_ns=UINT64,
    start=st.integers(0, 2**62),
    length=st.integers(0, 2**62),
    index_starts=st.dictionaries(st.integers(1, 2**16 - 1), UINT64, max_size=4),
    index_length=UINT64,
    stored_bytes=st.integers(0, 2**62),
    bytes=UINT64,
)
CHANNELS, ROW_BYTES = 20, 100


class Sink:
    """Counts bytes."""

    def __init__(self) -> None:
        self.bytes = 0

    def write(self, data: bytes, /) -> None:
        self.bytes += len(data)

    def flush(self) -> None:
        pass


def opened(file: io.BytesIO | Sink) -> McapWriter:
    writer = McapWriter(file, "", "test")
    schema = writer.register_schema("schema", "ros1msg", b"uint8 x\n")
    for number in range(CHANNELS):
        writer.register_channel(f"/{number}", "ros1", schema)
    return writer


def put(writer: McapWriter, chunks: int) -> None:
    """Write chunks as a log that is flushed five times a second."""
    for number in range(chunks):
        for channel in range(1, CHANNELS + 1 if number % 5 == 0 else 8):
            writer.add_message(channel, 200_000_000 * number, bytes(ROW_BYTES), number)
        writer.flush()


@given(st.lists(CHUNK, max_size=5))
def test_packed_chunks_are_given_back_equal(chunks: list[Chunk]) -> None:
    assert list(chunk_index._unpack(chunk_index._pack(chunks))) == chunks


def test_all_chunks_of_a_long_file_are_in_its_index() -> None:
    file, count = io.BytesIO(), 2 * BLOCK_CHUNKS + 3
    writer = opened(file)
    put(writer, count)
    writer.finish()
    reader = make_reader(io.BytesIO(file.getvalue()), validate_crcs=True)
    summary = reader.get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == count
    assert summary.statistics is not None
    assert summary.statistics.chunk_count == count
    assert summary.statistics.message_end_time == 200_000_000 * (count - 1)
    times = [m.log_time for _, _, m in reader.iter_messages(["/9"])]
    assert times == [200_000_000 * number for number in range(0, count, 5)]


def test_memory_of_an_open_file_is_flat() -> None:
    writer = opened(Sink())
    put(writer, BLOCK_CHUNKS)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        put(writer, 3 * BLOCK_CHUNKS)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # 432,000 chunks of a day: at most 10 MB (measured: 0.8 bytes a chunk, 1,030 uncompressed)
    assert (after - before) / (3 * BLOCK_CHUNKS) < 24.0


def test_index_gives_number_of_chunks_before_and_after_a_block() -> None:
    index, lengths = ChunkIndex(), []
    for number in range(BLOCK_CHUNKS + 2):
        index.add(Chunk(number, number, 9, 9, {}, 0, 0, 0))
        lengths.append(len(index))
    assert lengths == list(range(1, BLOCK_CHUNKS + 3))
    assert [len(block) for block in index.blocks()] == [BLOCK_CHUNKS, 2]
