"""Files of McapWriter, read by the MCAP project's library with every checksum verified."""

import contextlib
import io
import struct
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader

from mavlink_io.logging.mcap import CHUNK_BYTES, McapWriter, message_prefix

MESSAGE = st.tuples(
    st.integers(1, 3), st.integers(0, 2**63), st.binary(max_size=40_000), st.integers(0, 2**32 - 1)
)
FILE = st.tuples(st.text(max_size=20), st.integers(0, 2**63), st.binary(max_size=300))
FLUSH = st.just("flush")


def opened(file: io.BytesIO) -> McapWriter:
    writer = McapWriter(file, "ros1", "test")
    schemas = [writer.register_schema(f"schema {n}", "ros1msg", b"uint8 x\n" * n) for n in range(2)]
    for number in range(3):
        assert (
            writer.register_channel(f"/topic/{number}", "ros1", schemas[number % 2]) == number + 1
        )
    return writer


def put(writer: McapWriter, item: Any) -> None:
    match item:
        case "flush":
            writer.flush()
        case (int(channel), time_ns, data, sequence):
            writer.add_message(channel, time_ns, data, sequence)
        case (name, time_ns, data):
            writer.add_attachment(time_ns, name, "text/plain", data)
            writer.add_metadata(name, {"one": "1", name: "Ω"})


def messages(reader: Any) -> list[tuple[int, int, bytes, int]]:
    messages = reader.iter_messages(log_time_order=False)
    return [(m.channel_id, m.log_time, m.data, m.sequence) for _, _, m in messages]


@settings(max_examples=60)
@given(st.lists(st.one_of(MESSAGE, FILE, FLUSH), max_size=25))
def test_mcap_written_file_read_by_library_is_equal(items: list[Any]) -> None:
    file = io.BytesIO()
    writer = opened(file)
    for item in items:
        put(writer, item)
    writer.finish()
    written = [item for item in items if len(item) == 4]
    files = [item for item in items if len(item) == 3]

    streamed = NonSeekingReader(io.BytesIO(file.getvalue()), validate_crcs=True)
    assert messages(streamed) == written
    indexed = make_reader(io.BytesIO(file.getvalue()), validate_crcs=True)
    assert sorted(messages(indexed)) == sorted(written)
    assert [(a.name, a.log_time, a.data) for a in indexed.iter_attachments()] == files
    assert [m.metadata for m in indexed.iter_metadata()] == [
        {"one": "1", name: "Ω"} for name, _, _ in files
    ]
    summary = indexed.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(written)
    assert sum(summary.statistics.channel_message_counts.values()) == len(written)
    assert {c.topic for c in summary.channels.values()} == {"/topic/0", "/topic/1", "/topic/2"}
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count


def test_mcap_index_entries_point_to_messages() -> None:
    file = io.BytesIO()
    writer = opened(file)
    rows = writer.open_rows(((1, 0), (3, 36)))
    for n in range(3000):
        head = [
            message_prefix(c, 5) + n.to_bytes(4, "little") + n.to_bytes(8, "little") * 2
            for c in (1, 3)
        ]
        writer.add_row(rows, n, head[0] + b"first" + head[1] + b"third")
        writer.add_message(2, n, b"second", n)
    writer.finish()
    data = file.getvalue()
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) > 2
    counted = 0
    for chunk in summary.chunk_indexes:
        assert chunk.uncompressed_size < CHUNK_BYTES + 200
        for channel, start in chunk.message_index_offsets.items():
            times, offsets = index_at(data, start, channel)
            assert all(0 <= offset < chunk.uncompressed_size for offset in offsets)
            assert times == sorted(times)
            assert (min(times), max(times)) >= (chunk.message_start_time, 0)
            assert max(times) <= chunk.message_end_time
            counted += len(times)
    assert counted == 9000
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    assert [m.data for _, _, m in reader.iter_messages(["/topic/2"])] == [b"third"] * 3000
    assert [m.log_time for _, _, m in reader.iter_messages(["/topic/0"])] == list(range(3000))


def index_at(data: bytes, start: int, channel: int) -> tuple[list[int], list[int]]:
    assert data[start] == 0x07
    assert int.from_bytes(data[start + 9 : start + 11], "little") == channel
    length = int.from_bytes(data[start + 11 : start + 15], "little")
    numbers = memoryview(data[start + 15 : start + 15 + length]).cast("Q").tolist()
    return numbers[::2], numbers[1::2]


def test_mcap_unfinished_file_contains_flushed_data() -> None:
    file = io.BytesIO()
    writer = opened(file)
    writer.add_message(1, 7, b"kept", 1)
    writer.flush()
    writer.add_message(1, 8, b"lost", 2)
    records = StreamReader(io.BytesIO(file.getvalue()), validate_crcs=True).records
    contents: list[bytes] = []
    with contextlib.suppress(struct.error, McapError):
        contents.extend(record.data for record in records if isinstance(record, Message))
    assert contents == [b"kept"]


def test_mcap_same_messages_give_same_bytes() -> None:
    def file() -> bytes:
        out = io.BytesIO()
        writer = opened(out)
        for n in range(500):
            writer.add_message(1 + n % 3, n, bytes((n % 256,)) * 300, n)
        writer.finish()
        return out.getvalue()

    assert file() == file()
