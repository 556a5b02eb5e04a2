"""The vehicle's side of the LOG_* messages, for several clients at once.

It answers LOG_REQUEST_LIST, LOG_REQUEST_DATA, LOG_REQUEST_END and LOG_ERASE. Each list numbers the
logs from 0 without gaps, as MAVSDK requires. The numbers of a client mean the same files until it
requests the list again. Data are sent as fast as the client's link has room.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, BinaryIO, NamedTuple

from mavlink_io import dialect
from mavlink_io.codec import Frame, largest_frame
from mavlink_io.request import Client, MavlinkId, RoomBytes, Send
from mavlink_io.services.log_transfer.source import LogFile, LogSource

DATA_BYTES = 90
"""Bytes of a log in one LOG_DATA; a message with fewer is the end of the log."""
ALL = 0xFFFF_FFFF
"""LOG_REQUEST_DATA.count for the whole log, and the largest size that LOG_ENTRY can carry."""
MAX_RANGES = 32
"""Maximum number of waiting requests per client; MAVProxy requests up to 20 lost pieces at once."""
MAX_MESSAGES_PER_POLL = 200
"""Maximum number of LOG_DATA messages that a client is sent per poll."""

_MAX_FRAME_BYTES = largest_frame(dialect.by_name("LOG_DATA"))


class _Range(NamedTuple):
    """A requested part of a log."""

    log: int
    """Number of the log in the client's list."""
    start: int
    """Offset of the next byte to send."""
    stop: int
    """Offset after the last byte to send."""


class _Reader:
    """A client: the logs that its numbers mean, and its open requests."""

    def __init__(self, files: Sequence[LogFile], send: Send) -> None:
        self.files, self.send = tuple(files), send
        self.entries: deque[int] = deque()
        """Numbers of the logs whose LOG_ENTRY is still to be sent."""
        self.ranges: deque[_Range] = deque()
        """Parts of logs that are still to be sent."""
        self.room: RoomBytes


class LogServer:
    """Server of the LOG_* messages.

    Parameters
    ----------
    source : LogSource
        The vehicle's logs.
    explain : callable
        Send the operator the reason of a refusal.
    armed : callable
        Return whether the vehicle is armed; an armed vehicle erases no logs.
    """

    message_names = frozenset(
        ("LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_ERASE")
    )

    def __init__(
        self, source: LogSource, explain: Callable[[str], None], armed: Callable[[], bool]
    ) -> None:
        self._source, self._explain, self._armed = source, explain, armed
        self._readers: dict[Client, _Reader] = {}
        self._handlers = {
            "LOG_REQUEST_LIST": self._list,
            "LOG_REQUEST_DATA": self._data,
            "LOG_REQUEST_END": self._end,
            "LOG_ERASE": self._erase,
        }

    def feed(self, frame: Frame, send: Send, room: RoomBytes) -> None:
        """Process one frame that is addressed to this vehicle.

        Parameters
        ----------
        frame : Frame
            A frame of one of ``message_names``.
        send : Send
            Function that sends on the frame's link: the same object for every frame of a link.
        room : RoomBytes
            Return how many bytes of bulk data the frame's link accepts now.
        """
        client = Client(MavlinkId(frame.system, frame.component), send)
        reader = self._readers.get(client) or _Reader(self._source.files(), send)
        self._readers[client], reader.room = reader, room
        self._handlers[frame.name](reader, frame.decode())

    def poll(self) -> None:
        """Send entries and data of all requests, as far as the links have room."""
        for reader in self._readers.values():
            while reader.entries and reader.room() >= _MAX_FRAME_BYTES:
                self._send_entry(reader, reader.entries.popleft())
            if reader.ranges and reader.room() >= _MAX_FRAME_BYTES:
                _send_ranges(reader)

    def _list(self, reader: _Reader, message: Any) -> None:
        """Begin to send a list of the present logs."""
        reader.files = tuple(self._source.files())
        reader.entries.clear()
        last = min(message.end, len(reader.files) - 1)
        reader.entries.extend(range(message.start, last + 1))
        if not reader.files:
            reader.send("LOG_ENTRY", id=0, num_logs=0, last_log_num=0, time_utc=0, size=0)

    def _send_entry(self, reader: _Reader, number: int) -> None:
        """Send the LOG_ENTRY of one log."""
        log, count = reader.files[number], len(reader.files)
        reader.send(
            "LOG_ENTRY",
            id=number,
            num_logs=count,
            last_log_num=count - 1,
            time_utc=log.began_unix_s & 0xFFFF_FFFF,
            size=min(log.bytes, ALL),
        )

    def _data(self, reader: _Reader, message: Any) -> None:
        """Queue a requested range; answer an empty range with an empty LOG_DATA.

        No empty LOG_DATA follows the last full one without a request: MAVProxy would take it for
        the end of the log, even if pieces are missing. MAVProxy requests more when none is missing.
        """
        size = reader.files[message.id].bytes if message.id < len(reader.files) else 0
        requested = _Range(message.id, message.ofs, min(message.ofs + message.count, size))
        if requested.start >= requested.stop:
            _send_data(reader, message.id, message.ofs, b"")
            return
        replaces_waiting = message.count == ALL or any(
            waiting.log != message.id for waiting in reader.ranges
        )
        if replaces_waiting:
            reader.ranges.clear()
        if requested not in reader.ranges and len(reader.ranges) < MAX_RANGES:
            reader.ranges.append(requested)

    def _end(self, reader: _Reader, message: Any) -> None:
        """Stop sending data."""
        reader.ranges.clear()

    def _erase(self, reader: _Reader, message: Any) -> None:
        """Erase the logs, unless the vehicle is armed."""
        refusal = "Logs not erased: armed" if self._armed() else self._source.erase()
        if refusal:
            self._explain(refusal)
            return
        for other in self._readers.values():
            other.files, other.entries, other.ranges = (), deque(), deque()


def _send_ranges(reader: _Reader) -> None:
    """Send data of the requested ranges; end the requests of a log that cannot be read."""
    number = reader.ranges[0].log
    try:
        with reader.files[number].path.open("rb") as file:
            _send_from(file, reader, number)
    except OSError:
        _send_data(reader, number, reader.ranges[0].start, b"")
        reader.ranges.clear()


def _send_from(file: BinaryIO, reader: _Reader, number: int) -> None:
    """Send data of the requested ranges of one open log, as far as the link has room."""
    for _ in range(MAX_MESSAGES_PER_POLL):
        if not reader.ranges or reader.ranges[0].log != number or reader.room() < _MAX_FRAME_BYTES:
            return
        current = reader.ranges[0]
        file.seek(current.start)
        data = file.read(min(DATA_BYTES, current.stop - current.start))
        _send_data(reader, number, current.start, data)
        next_start = current.start + len(data)
        if data and next_start < current.stop:
            reader.ranges[0] = current._replace(start=next_start)
        else:
            reader.ranges.popleft()


def _send_data(reader: _Reader, number: int, offset: int, data: bytes) -> None:
    """Send one LOG_DATA."""
    padded = tuple(data.ljust(DATA_BYTES, b"\0"))
    reader.send("LOG_DATA", id=number, ofs=offset, count=len(data), data=padded)
