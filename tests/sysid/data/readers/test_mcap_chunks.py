"""The messages of an MCAP file are those that the mcap library reads, whatever wrote it."""

import io

import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from sysid.data.readers import mcap_chunks

HOWEVER_WRITTEN = {
    "chunked": {"chunk_size": 200},
    "not compressed": {"chunk_size": 200, "compression": CompressionType.NONE},
    "no index": {"index_types": IndexType.NONE},
    "no chunks": {"use_chunking": False},
}


def written(**how: object) -> io.BytesIO:
    file = io.BytesIO()
    writer = Writer(file, **how)
    writer.start("ros1", "a test")
    schema = writer.register_schema("Number", "ros1msg", b"uint8 number\n")
    numbers = [
        writer.register_channel(f"/{name}", "ros1", schema)
        for name in ("wanted", "not", "wanted too")
    ]
    for k in range(100):
        data = bytes((k,)) * (1 + k % 4)
        writer.add_message(numbers[k % 3], log_time=1000 + k, publish_time=k, data=data, sequence=7)
    writer.finish()
    file.seek(0)
    return file


@pytest.mark.parametrize("how", HOWEVER_WRITTEN.values(), ids=HOWEVER_WRITTEN)
def test_messages_are_those_that_the_library_reads(how: dict[str, object]) -> None:
    file = written(**how)
    summary = make_reader(file).get_summary()
    wanted = {number for number, channel in summary.channels.items() if channel.topic != "/not"}
    found = list(mcap_chunks.messages(file, summary, wanted))
    file.seek(0)
    theirs = make_reader(file).iter_messages(
        topics=["/wanted", "/wanted too"], log_time_order=False
    )
    assert found == [(channel.id, message.log_time, message.data) for _, channel, message in theirs]
    assert len(found) == 67


def test_a_chunk_that_ends_within_a_record_is_refused() -> None:
    with pytest.raises(McapError):
        list(mcap_chunks._select_messages(bytes((5, 30, 0, 0, 0, 0, 0, 0, 0, 1)), {1}))
