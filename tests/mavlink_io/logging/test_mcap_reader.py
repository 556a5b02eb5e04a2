"""McapReader gives the same items as the MCAP project's library, and reports damage."""

import io
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType, IndexType, Writer

from mavlink_io.logging.mcap import McapWriter
from mavlink_io.logging.mcap_reader import (
    McapBatch,
    McapChannel,
    McapError,
    McapItem,
    McapMessage,
    McapReader,
    format_damage,
)

HOWEVER_WRITTEN: dict[str, dict[str, Any]] = {
    "chunked": {"chunk_size": 200},
    "not compressed": {"chunk_size": 200, "compression": CompressionType.NONE},
    "lz4": {"chunk_size": 200, "compression": CompressionType.LZ4},
    "no index": {"index_types": IndexType.NONE},
    "no chunks": {"use_chunking": False},
    "no checksums": {"enable_crcs": False, "chunk_size": 200},
    "checksum of the data section": {"enable_data_crcs": True, "chunk_size": 200},
    "nothing repeated": {"repeat_channels": False, "repeat_schemas": False},
    "no statistics": {"use_statistics": False},
}
FIRST_NS = 1_000_000_000
STEP_NS = 100_000_000
COUNT = 90


def written(**how: Any) -> bytes:
    file = io.BytesIO()
    writer = Writer(file, **how)
    writer.start("ros1", "a test")
    schema = writer.register_schema("Number", "ros1msg", b"uint8 number\n")
    names = ("wanted", "not", "wanted too")
    numbers = [writer.register_channel(f"/{name}", "ros1", schema) for name in names]
    for k in range(COUNT):
        data = bytes((k,)) * (1 + k % 4)
        time_ns = FIRST_NS + k * STEP_NS
        writer.add_message(numbers[k % 3], time_ns, data, publish_time=k, sequence=7)
    writer.add_attachment(1, 2, "file", "text/plain", b"attached")
    writer.add_metadata("notes", {"one": "1"})
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


def written_by_us(chunks: int = 3, finish: bool = True) -> bytes:
    """Return a file with ``COUNT`` messages in chunks; all definitions are in the first chunk."""
    file = io.BytesIO()
    writer = McapWriter(file, "", "a test")
    schema = writer.register_schema("Number", "ros1msg", b"uint8 number\n")
    numbers = [writer.register_channel(f"/{n}", "ros1", schema) for n in ("wanted", "not")]
    for k in range(COUNT):
        writer.add_message(numbers[k % 2], FIRST_NS + k * STEP_NS, bytes((k,)) * 40, k)
        if (k + 1) % (COUNT // chunks) == 0:
            writer.flush()
    writer.add_metadata("notes", {"one": "1"})
    if finish:
        writer.finish()
    return file.getvalue()


def read(data: bytes) -> tuple[list[McapItem], McapReader]:
    reader = McapReader(io.BytesIO(data))
    return list(reader.items()), reader


def values(items: Iterable[McapItem]) -> list[int]:
    return [item.data[0] for item in items if isinstance(item, McapMessage)]


def place(data: bytes, opcode: int, number: int = 0) -> int:
    """Return the position of the content of a record of the data section."""
    position = 8
    while True:
        kind, length = struct.unpack_from("<BQ", data, position)
        if kind == opcode:
            if number == 0:
                return position + 9
            number -= 1
        position += 9 + length


def changed(data: bytes, position: int, by: int = 1) -> bytes:
    damaged = bytearray(data)
    damaged[position] ^= by
    return bytes(damaged)


@pytest.mark.parametrize("how", HOWEVER_WRITTEN.values(), ids=HOWEVER_WRITTEN)
def test_reader_items_equal_the_librarys(how: dict[str, object]) -> None:
    data = written(**how)
    reader = McapReader(io.BytesIO(data), lambda channel: channel.topic != "/not")
    items = list(reader.items())
    topics = {item.number: item.topic for item in items if isinstance(item, McapChannel)}
    library = NonSeekingReader(io.BytesIO(data), validate_crcs=True)
    theirs = library.iter_messages(["/wanted", "/wanted too"], log_time_order=False)
    expected = [(c.topic, m.sequence, m.log_time, m.data) for _, c, m in theirs]
    messages = [(topics[i.channel], *i[1:]) for i in items if isinstance(i, McapMessage)]
    assert messages == expected
    assert len(messages) == 2 * COUNT // 3
    assert sorted(topics.values()) == ["/not", "/wanted", "/wanted too"]
    others = [i[-1] for i in items if not isinstance(i, McapMessage | McapChannel)]
    assert others == [b"attached", {"one": "1"}]
    assert (reader.finished, reader.damage) == (True, [])


def test_writer_data_checksum_equals_the_librarys() -> None:
    data = written_by_us()
    declared = struct.unpack_from("<I", data, place(data, 15))[0]
    assert declared != 0
    messages = NonSeekingReader(io.BytesIO(data), validate_crcs=True).iter_messages()
    assert len(list(messages)) == COUNT


def test_reader_damaged_chunk_is_skipped_and_reported() -> None:
    data = written_by_us()
    items, reader = read(changed(data, place(data, 6, 1) + 60))
    assert values(items) == [*range(30), *range(60, 90)]
    (damage,) = reader.damage
    assert (damage.first_ns, damage.last_ns) == (FIRST_NS + 30 * STEP_NS, FIRST_NS + 59 * STEP_NS)
    words = format_damage(reader)
    assert words.startswith(f"chunk at byte {place(data, 6, 1) - 9}: ")
    assert words.endswith("(3.00 to 5.90 s of the log are lost)")


def test_reader_lost_channels_are_taken_from_summary() -> None:
    data = written_by_us()
    items, reader = read(changed(data, place(data, 6) + 60))
    assert values(items) == list(range(30, 90))
    assert {i.topic for i in items if isinstance(i, McapChannel)} == {"/wanted", "/not"}
    assert len(reader.damage) == 1


def test_reader_lost_channels_without_summary_lose_messages() -> None:
    data = written_by_us(finish=False)
    items, reader = read(changed(data, place(data, 6) + 60))
    assert values(items) == []
    assert not reader.finished
    assert ["not described" in damage.reason for damage in reader.damage] == [False, True, True]


def test_reader_broken_record_length_keeps_later_chunks() -> None:
    """The length of a message index is 8 bytes before its content."""
    data = written_by_us()
    for bit in range(20):
        position = place(data, 7) - 8 + bit // 8
        items, reader = read(changed(data, position, 1 << bit % 8))
        assert values(items) == list(range(90))
        assert reader.damage


def test_reader_unknown_compression_is_reported() -> None:
    """Private record types, from 0x80 on, are legal, and a reader skips them."""
    data = written_by_us()
    items, reader = read(changed(data, place(data, 6, 1) - 9, 0x80))
    assert values(items) == [*range(30), *range(60, 90)]
    assert "3.00 to 5.90 s" in format_damage(reader)


def test_reader_damage_outside_chunks_fails_data_checksum() -> None:
    data = written_by_us()
    _, reader = read(changed(data, data.index(b"notes") + 1))
    words = format_damage(reader)
    assert words == "the checksum of its data section is wrong, its chunks are whole"


def test_reader_damaged_summary_keeps_messages() -> None:
    data = written_by_us()
    start = struct.unpack_from("<Q", data, len(data) - 28)[0]
    items, reader = read(changed(data, start + 20))
    assert values(items) == list(range(90))
    assert format_damage(reader) == "the checksum of its summary is wrong"


def test_reader_missing_chunk_differs_from_statistics() -> None:
    """The file has no data checksum and no index; readers skip the second chunk's record."""
    data = written(chunk_size=200, index_types=IndexType.NONE)
    _, reader = read(changed(data, place(data, 6, 1) - 9, 0x80))
    assert "its statistics say 90" in format_damage(reader)


def test_reader_chunk_with_cut_record_is_damage() -> None:
    inner = bytes((5, 30, 0, 0, 0, 0, 0, 0, 0, 1))
    chunk = struct.pack("<QQQI", 0, 0, len(inner), 0) + bytes(4)
    chunk += struct.pack("<Q", len(inner)) + inner
    header = b"\x89MCAP0\r\n" + struct.pack("<BQ", 1, 8) + bytes(8)
    _, reader = read(header + struct.pack("<BQ", 6, len(chunk)) + chunk)
    assert "a record in it reaches beyond its end" in format_damage(reader)


def test_reader_other_file_type_raises_error() -> None:
    for data in (b"", b"MCAP", b"not an MCAP file, but longer than its magic bytes"):
        with pytest.raises(McapError, match="magic"):
            McapReader(io.BytesIO(data))


@pytest.mark.parametrize("finish", [True, False])
def test_reader_cut_file_gives_complete_chunks_only(finish: bool) -> None:
    data = written_by_us(finish=finish)
    for length in range(8, len(data), 7):
        items, reader = read(data[:length])
        assert values(items) == list(range(len(values(items))))
        assert not reader.finished


@pytest.mark.parametrize("hurt", [False, True])
def test_batches_hold_the_messages_of_each_channel_in_order(hurt: bool) -> None:
    data = written_by_us()
    if hurt:
        data = changed(data, place(data, Opcode.CHUNK, 1) + 60)
    one_by_one, reader = read(data)
    batched = McapReader(io.BytesIO(data), batched=True)
    expected: dict[int, list[tuple[int, bytes]]] = {}
    for item in one_by_one:
        if isinstance(item, McapMessage):
            expected.setdefault(item.channel, []).append((item.time_ns, item.data))
    found: dict[int, list[tuple[int, bytes]]] = {}
    for item in batched.items():
        assert not isinstance(item, McapMessage)
        if isinstance(item, McapBatch):
            ends = np.cumsum(item.lengths)
            payloads = [item.data[e - n : e] for e, n in zip(ends, item.lengths, strict=True)]
            rows = zip(item.times_ns, payloads, strict=True)
            found.setdefault(item.channel, []).extend(rows)
    assert found == expected
    assert batched.damage == reader.damage
    assert bool(reader.damage) == hurt
