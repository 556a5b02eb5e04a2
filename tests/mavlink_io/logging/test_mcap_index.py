"""Index of MCAP records: places of messages, and records that exceed their chunk."""

import struct

import numpy as np
import pytest

from mavlink_io import jit
from mavlink_io.logging import mcap_index

needs_numba = pytest.mark.skipif(not jit.COMPILED, reason="the index is used with numba only")


def message(channel: int, time_ns: int, payload: bytes) -> bytes:
    """Return a message record."""
    content = struct.pack("<HIQQ", channel, 0, time_ns, time_ns) + payload
    return struct.pack("<BQ", mcap_index.MESSAGE_OPCODE, len(content)) + content


@needs_numba
def test_index_finds_messages_of_each_channel_in_order() -> None:
    time_ns = 1_790_000_000_123_456_789
    other = struct.pack("<BQ", 4, 3) + b"abc"
    first = message(7, time_ns, b"one") + other
    second = message(700, time_ns + 1, b"") + message(7, time_ns + 2, b"three")
    data = first + second
    index = mcap_index.index_records(data, [len(first), len(data)])
    assert index is not None
    assert mcap_index.message_counts(index) == {7: 2, 700: 1}
    assert mcap_index.first_time_ns(index) == time_ns
    ((opcode, start, stop),) = mcap_index.other_records(index)
    assert (opcode, data[start:stop]) == (4, b"abc")
    found = mcap_index.messages(data, index, 7)
    assert np.array_equal(found.times_ns, [time_ns, time_ns + 2])
    assert np.array_equal(found.lengths, [3, 5])
    assert found.data == b"onethree"


@needs_numba
@pytest.mark.parametrize(
    "records",
    [
        message(1, 0, b"abc")[:-1],
        message(1, 0, b"abc") + b"\x05",
        struct.pack("<BQ", 5, 21) + bytes(21),
        struct.pack("<BQ", 4, 2**63) + bytes(8),
        message(1, 2**63, b"abc"),
    ],
    ids=["cut", "cut head", "short message", "length of 2^63", "time of 2^63"],
)
def test_index_impossible_record_gives_none(records: bytes) -> None:
    assert mcap_index.index_records(records, [len(records)]) is None


@needs_numba
def test_index_record_across_two_chunks_gives_none() -> None:
    records = message(1, 0, b"abc")
    assert mcap_index.index_records(records, [20, len(records)]) is None
