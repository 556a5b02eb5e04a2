"""MAVLink telemetry logs (.tlog).

Each frame follows its UNIX time in microseconds (8 bytes, big-endian). QGroundControl, Mission
Planner, MAVProxy (``mav.tlog``) and pymavlink's tools use the same format.
"""

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
    """A tlog that is being written.

    Time stamps never decrease, because a program that replays the log waits from stamp to stamp.

    Parameters
    ----------
    path : Path
        The file; an old one is overwritten.

    Raises
    ------
    OSError
        The file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
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

    A message without a time field has the latest earlier time of its sender."""
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
    latest_us: dict[tuple[int, int], int] = {}
    for frame in Framer().feed(data + bytes(LARGEST_FRAME)):
        message = dialect.by_id(frame.message_id)
        assert message is not None, "a framer without senders rejects undefined messages"
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
        previous_us = latest_us.get(key[:2], 0)
        read_time_us = _time_reader(frame.message_id)
        own_us = read_time_us(payload) if read_time_us else None
        latest_us[key[:2]] = max(previous_us, own_us or 0)
        series.times_us.append(previous_us if own_us is None else own_us)
        series.payloads.append(payload)
    return list(all_series.values())


@cache
def _time_reader(message_id: int) -> Callable[[bytes], int | None] | None:
    """Return the function that reads the vehicle time of a message, None if it has none."""
    message = dialect.by_id(message_id)
    return vehicle_time_reader(message) if message else None
