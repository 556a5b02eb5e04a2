"""MAVLink telemetry logs (.tlog).

Each frame follows its UNIX time in microseconds (8 bytes, big-endian). QGroundControl, Mission
Planner, MAVProxy (``mav.tlog``) and pymavlink's tools use the same format.
"""

import itertools
import struct
from collections.abc import Sequence
from typing import BinaryIO, NamedTuple

from mavlink_io import dialect
from mavlink_io.codec import MAGIC_V1, MAGIC_V2, MAX_FRAME_BYTES, Framer, is_intact
from mavlink_io.dialect import MessageType
from mavlink_io.logging.ros1 import time_reader
from mavlink_io.vehicle_clock import unwrap_us

_STAMP = struct.Struct(">Q")
_OVERHEAD = {MAGIC_V2: 12, MAGIC_V1: 8}
"""Bytes of a frame besides its payload, by its first byte."""
_SIGNED, _SIGNATURE_LENGTH = 1, 13
"""Flag of a signed frame, and length of its signature."""
_OUTPUTS = dialect.by_name("SERVO_OUTPUT_RAW").message_id
_OUTPUTS_TIME = struct.Struct("<I")
"""Field ``time_usec`` of SERVO_OUTPUT_RAW, which wraps after 72 minutes; 0 if it is not filled."""
_RESYNC_FRAMES = 3
"""Number of consecutive frames required after damage, so that a chance match is unlikely."""


class TelemetryLog:
    """A tlog that is being written.

    Time stamps never decrease, because a program that replays the log waits from stamp to stamp.

    Parameters
    ----------
    file : BinaryIO
        New file, opened in binary mode.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._time_us = 0

    def write(self, time_us: int, raw: bytes) -> None:
        """Write one frame.

        Parameters
        ----------
        time_us : int
            UNIX time, in microseconds.
        raw : bytes
            The frame.
        """
        self._time_us = max(self._time_us, time_us)
        self._file.write(_STAMP.pack(self._time_us) + raw)

    def flush(self) -> None:
        """Pass all written bytes to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class MessageSeries(NamedTuple):
    """All messages of one type from one sender, in the order of arrival."""

    system: int
    component: int
    message: MessageType
    times_us: list[int]
    """Vehicle time of each message, in microseconds.

    A message without a time field has the latest earlier time of its sender, plus the time since
    that message was received. If the sender gives no other time, its first SERVO_OUTPUT_RAW gives
    the time at which that was received."""
    payloads: list[bytes]
    """Payloads at full length."""


def read(data: bytes) -> list[MessageSeries]:
    """Return the messages of a tlog.

    Parameters
    ----------
    data : bytes
        Content of the file. Bytes that belong to no frame are skipped, and so is an incomplete
        frame at the end.

    Returns
    -------
    list of MessageSeries
        One series per sender and message type.
    """
    all_series: dict[tuple[int, int, int], MessageSeries] = {}
    senders: dict[tuple[int, int], list[_Arrival]] = {}
    offset, padded = 0, data + bytes(MAX_FRAME_BYTES)
    for frame in Framer().feed(padded):
        message = dialect.by_id(frame.message_id)
        assert message is not None, "a framer without senders rejects undefined messages"
        start = padded.index(frame.raw, offset)
        offset = start + len(frame.raw)
        key = frame.system, frame.component, frame.message_id
        series = all_series.setdefault(
            key,
            MessageSeries(
                system=frame.system,
                component=frame.component,
                message=message,
                times_us=[],
                payloads=[],
            ),
        )
        payload = frame.payload[: message.struct.size].ljust(message.struct.size, b"\0")
        read_time_us = time_reader(frame.message_id)
        senders.setdefault(key[:2], []).append(
            _Arrival(
                series,
                _STAMP.unpack_from(padded, start - _STAMP.size)[0] if start >= _STAMP.size else 0,
                read_time_us(payload) if read_time_us else None,
            )
        )
        series.payloads.append(payload)
    everything = itertools.chain.from_iterable(senders.values())
    timed = next((a for a in everything if a.own_us is not None), None)
    for arrivals in senders.values():
        first = next((a for a in arrivals if a.own_us is not None), None)
        _set_times(arrivals, first or _first_outputs(arrivals) or timed or arrivals[0])
    return list(all_series.values())


class _Arrival(NamedTuple):
    """Message of a sender, when it was received, and its own time, in microseconds."""

    series: MessageSeries
    received_us: int
    own_us: int | None


def _first_outputs(arrivals: Sequence[_Arrival]) -> _Arrival | None:
    """Return the first SERVO_OUTPUT_RAW that has a time, with this time; None without any."""
    outputs = [a for a in arrivals if a.series.message.message_id == _OUTPUTS]
    payloads = outputs[0].series.payloads if outputs else []
    times = (_OUTPUTS_TIME.unpack_from(payload)[0] for payload in payloads)
    timed = (a._replace(own_us=us) for a, us in zip(outputs, times, strict=True) if us)
    return next(timed, None)


def _set_times(arrivals: Sequence[_Arrival], first: _Arrival) -> None:
    """Append the vehicle time of each message of one sender to its series.

    ``first`` is the first message with a time, of this sender or, if it sends none, of another.
    Messages before it have its time minus the time until it was received.
    """
    time_us, received_us = first.own_us or 0, first.received_us
    shortest_us = -time_us
    for arrival in arrivals:
        own_us = arrival.own_us
        if own_us is None:
            own_us = time_us + max(shortest_us, arrival.received_us - received_us)
        else:
            shortest_us, own_us = 0, unwrap_us(own_us, time_us)
            if own_us >= time_us:
                time_us, received_us = own_us, arrival.received_us
        arrival.series.times_us.append(own_us)


class TlogDamage(NamedTuple):
    """Bytes of a tlog that belong to no frame."""

    skipped_bytes: int
    """Number of such bytes before the last whole frame."""
    places: int
    """Number of places with such bytes before the last whole frame."""
    trailing_bytes: int
    """Number of such bytes after it: the file ends within a frame."""


def find_damage(data: bytes) -> TlogDamage:
    """Return the bytes of a tlog that belong to no frame, by lengths and checksums.

    Parameters
    ----------
    data : bytes
        Content of the file.

    Returns
    -------
    TlogDamage
        Number of bytes and places. The frame of an unknown message counts as whole if any seed
        explains its checksum.
    """
    offset = end = skipped = places = 0
    resynchronising = False
    while offset + _STAMP.size < len(data):
        following = _frame_end(data, offset)
        if following is None or (resynchronising and not _is_frame_sequence(data, offset)):
            resynchronising, offset = True, offset + 1
            continue
        if not is_intact(data[offset + _STAMP.size : following]):
            offset, resynchronising = following, False
            continue
        if offset > end:
            skipped, places = skipped + offset - end, places + 1
        offset = end = following
        resynchronising = False
    return TlogDamage(skipped, places, len(data) - end)


def _frame_end(data: bytes, offset: int) -> int | None:
    """Return the end of the frame whose time stamp begins at an offset; None without a frame."""
    start = offset + _STAMP.size
    if start + 3 > len(data) or data[start] not in _OVERHEAD:
        return None
    end = start + _OVERHEAD[data[start]] + data[start + 1]
    if data[start] == MAGIC_V2 and data[start + 2] & _SIGNED:
        end += _SIGNATURE_LENGTH
    return end if end <= len(data) else None


def _is_frame_sequence(data: bytes, offset: int) -> bool:
    """Return True if _RESYNC_FRAMES frames, or all up to the end, follow each other."""
    position: int | None = offset
    for _ in range(_RESYNC_FRAMES):
        position = _frame_end(data, position) if position is not None else None
        if position is None or position == len(data):
            return position is not None
    return True
