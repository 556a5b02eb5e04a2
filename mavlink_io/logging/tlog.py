"""A MAVLink telemetry log (.tlog): each frame as it came, after the UNIX time in microseconds as 8
bytes, big-endian.

QGroundControl, Mission Planner, MAVProxy and pymavlink's tools read it; the format is theirs
(MAVProxy's ``mav.tlog``)."""

import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mavlink_io import dialect
from mavlink_io.codec import LARGEST_FRAME, Framer
from mavlink_io.dialect import MessageType
from mavlink_io.logging.ros1 import vehicle_time_reader

_STAMP = struct.Struct(">Q")


class TelemetryLog:
    """An open tlog. A reader that replays it waits from stamp to stamp, so no stamp is before the
    last one."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._time_us = 0

    def write(self, time_us: int, raw: bytes) -> None:
        """Add a frame; ``time_us`` is UNIX time."""
        self._time_us = max(self._time_us, time_us)
        self._file.write(_STAMP.pack(self._time_us) + raw)

    def flush(self) -> None:
        """Hand what was written to the operating system now."""
        self._file.flush()

    def close(self) -> None:
        self._file.close()


class MessageSeries(NamedTuple):
    """The messages of one name that one sender sent, in the order in which they came."""

    system: int
    component: int
    message: MessageType
    times_us: list[int]
    """Vehicle time: the message's own, or for one that carries none, the latest that its sender
    told before."""
    payloads: list[bytes]
    """At full length."""


def read(data: bytes) -> list[MessageSeries]:
    """What a tlog holds. Bytes that belong to no frame are passed over, and so is a torn end."""
    streams: dict[tuple[int, int, int], MessageSeries] = {}
    latest_us: dict[tuple[int, int], int] = {}
    for frame in Framer().feed(data + bytes(LARGEST_FRAME)):
        message = dialect.by_id(frame.message_id)
        assert message is not None, "a framer without senders refuses what the dialect lacks"
        key = frame.system, frame.component, frame.message_id
        stream = streams.setdefault(
            key, MessageSeries(frame.system, frame.component, message, [], [])
        )
        payload = frame.payload[: message.struct.size].ljust(message.struct.size, b"\0")
        before_us = latest_us.get(key[:2], 0)
        read_time_us = _time_reader(frame.message_id)
        own_us = read_time_us(payload) if read_time_us else None
        latest_us[key[:2]] = max(before_us, own_us or 0)
        stream.times_us.append(before_us if own_us is None else own_us)
        stream.payloads.append(payload)
    return list(streams.values())


@cache
def _time_reader(message_id: int) -> Callable[[bytes], int | None] | None:
    message = dialect.by_id(message_id)
    return vehicle_time_reader(message) if message else None
