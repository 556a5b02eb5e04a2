"""Index of the records in unpacked MCAP chunks, as compiled code.

Chunks of telemetry hold about sixty small messages each. A compiled loop over many chunks takes a
tenth of the time of `struct` calls in Python.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import COMPILED, entry_point

Bytes = NDArray[np.uint8]
Index = NDArray[np.int64]

MESSAGE_OPCODE = 5
NOT_A_MESSAGE = -1
"""Value of the column CHANNEL of other records."""
CHANNEL, TIME_NS, START, STOP = range(4)
"""Columns of the index; START and STOP enclose the payload of a message or the content of another
record. Column TIME_NS holds the opcode of other records."""

_RECORD_HEAD_BYTES, _MESSAGE_HEAD_BYTES = 9, 22
"""Opcode and length of a record; channel, sequence number, log time and publish time."""


def index_records(data: bytes, ends: list[int]) -> Index | None:
    """Return the index of all records.

    Parameters
    ----------
    data : bytes
        Records of several chunks, one chunk after the other.
    ends : list of int
        End of each chunk in ``data``.

    Returns
    -------
    ndarray, shape (records, 4), or None
        Columns CHANNEL, TIME_NS, START and STOP; None if a record is too short or exceeds its
        chunk, or without numba.
    """
    if not COMPILED:
        return None
    index = np.empty((len(data) // _RECORD_HEAD_BYTES + 1, 4), np.int64)
    count = _fill(np.frombuffer(data, np.uint8), np.array(ends, np.int64), index)
    return None if count < 0 else index[:count]


def other_records(index: Index) -> list[list[int]]:
    """Return opcode, start and stop of each record that is not a message, in order."""
    others = index[index[:, CHANNEL] == NOT_A_MESSAGE, TIME_NS:]
    return others.tolist()  # type: ignore[no-any-return]


def message_counts(index: Index) -> dict[int, int]:
    """Return the number of messages of each channel."""
    numbers, counts = np.unique(index[:, CHANNEL], return_counts=True)
    found = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
    found.pop(NOT_A_MESSAGE, None)
    return found


class Messages(NamedTuple):
    """Messages of one channel, in the order of the file."""

    times_ns: Index
    lengths: Index
    data: bytes
    """Payloads, one after the other."""


def messages(data: bytes, index: Index, channel: int) -> Messages:
    """Return the messages of one channel.

    Parameters
    ----------
    data : bytes
        Data of which ``index`` is the index.
    index : ndarray, shape (records, 4)
        Result of `index_records`.
    channel : int
        Number of the channel.

    Returns
    -------
    Messages
        Log times, lengths and payloads.
    """
    rows = index[index[:, CHANNEL] == channel]
    lengths = rows[:, STOP] - rows[:, START]
    payloads = np.empty(int(lengths.sum()), np.uint8)
    _copy(np.frombuffer(data, np.uint8), rows, payloads)
    return Messages(rows[:, TIME_NS].copy(), lengths, payloads.tobytes())


def first_time_ns(index: Index) -> int:
    """Return the log time of the first message."""
    return int(index[index[:, CHANNEL] != NOT_A_MESSAGE, TIME_NS][0])


@entry_point
def _fill(data: Bytes, ends: Index, index: Index) -> int:
    """Write one row per record into ``index``; return their number, negative after an error."""
    count, position = 0, 0
    for end in ends:
        while position < end:
            start = position + _RECORD_HEAD_BYTES
            if start > end or data[position + 8] > 0:
                return -1
            length = 0
            for k in range(7, 0, -1):
                length = length * 256 + data[position + k]
            stop = start + length
            if stop > end:
                return -1
            row = index[count]
            if data[position] == MESSAGE_OPCODE:
                if length < _MESSAGE_HEAD_BYTES or data[start + 13] > 127:
                    return -1
                time_ns = 0
                for k in range(13, 5, -1):
                    time_ns = time_ns * 256 + data[start + k]
                row[CHANNEL], row[TIME_NS] = data[start] + 256 * data[start + 1], time_ns
                row[START], row[STOP] = start + _MESSAGE_HEAD_BYTES, stop
            else:
                row[CHANNEL], row[TIME_NS] = NOT_A_MESSAGE, data[position]
                row[START], row[STOP] = start, stop
            count += 1
            position = stop
    return count


@entry_point
def _copy(data: Bytes, rows: Index, payloads: Bytes) -> None:
    """Copy the payloads of the rows one after the other into ``payloads``."""
    position = 0
    for row in rows:
        for k in range(row[START], row[STOP]):
            payloads[position] = data[k]
            position += 1
