"""The vehicle's side of LOG_REQUEST_LIST, LOG_REQUEST_DATA, LOG_REQUEST_END and LOG_ERASE, for
several clients at once.

Logs are numbered from 0 for each listing, without gaps, as MAVSDK wants it: a client's numbers mean
the same files until it asks for the list again. Data leaves as fast as the client's link has room.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, BinaryIO, NamedTuple

from mavlink_io import dialect
from mavlink_io.codec import Frame, largest_frame
from mavlink_io.request import Client, MavlinkId, RoomBytes, Send
from mavlink_io.services.log_transfer.source import LogFile, LogSource

DATA_BYTES = 90
"""Of a log in one LOG_DATA; fewer say that the log ends."""
ALL = 0xFFFF_FFFF
MAX_RANGES = 32
"""MAVProxy asks for up to 20 at once where data was lost."""
MAX_MESSAGES_PER_POLL = 200
"""How many messages a client is sent in one go where its link takes more."""

_MAX_FRAME_BYTES = largest_frame(dialect.by_name("LOG_DATA"))


class _Range(NamedTuple):
    """A part of a log that somebody asked for."""

    log: int
    start: int
    stop: int


class _Reader:
    """What a client was told the numbers mean, and what it is still to be sent."""

    def __init__(self, files: Sequence[LogFile], send: Send) -> None:
        self.files, self.send = tuple(files), send
        self.entries: deque[int] = deque()
        self.ranges: deque[_Range] = deque()
        self.room: RoomBytes


class LogServer:
    """Lists and sends the logs of a source."""

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
        """Serve one frame that is addressed to this vehicle; ``send`` and ``room`` are of the link
        it came by."""
        client = Client(MavlinkId(frame.system, frame.component), send)
        reader = self._readers.get(client) or _Reader(self._source.files(), send)
        self._readers[client], reader.room = reader, room
        self._handlers[frame.name](reader, frame.decode())

    def poll(self) -> None:
        """Send on what was asked for, as far as there is room."""
        for reader in self._readers.values():
            while reader.entries and reader.room() >= _MAX_FRAME_BYTES:
                self._tell(reader, reader.entries.popleft())
            if reader.ranges and reader.room() >= _MAX_FRAME_BYTES:
                _send_ranges(reader)

    def _list(self, reader: _Reader, message: Any) -> None:
        reader.files = tuple(self._source.files())
        reader.entries.clear()
        last = min(message.end, len(reader.files) - 1)
        reader.entries.extend(range(message.start, last + 1))
        if not reader.files:
            reader.send("LOG_ENTRY", id=0, num_logs=0, last_log_num=0, time_utc=0, size=0)

    def _tell(self, reader: _Reader, number: int) -> None:
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
        """Where there is nothing to send, an empty message says so. Nobody is sent one unasked
        after the last full one: MAVProxy takes it for the end, whatever it still lacks, and asks
        for more by itself once it lacks nothing."""
        size = reader.files[message.id].bytes if message.id < len(reader.files) else 0
        wanted = _Range(message.id, message.ofs, min(message.ofs + message.count, size))
        if wanted.start >= wanted.stop:
            _send_data(reader, message.id, message.ofs, b"")
            return
        moved_on = message.count == ALL or any(
            waiting.log != message.id for waiting in reader.ranges
        )
        if moved_on:
            reader.ranges.clear()
        if wanted not in reader.ranges and len(reader.ranges) < MAX_RANGES:
            reader.ranges.append(wanted)

    def _end(self, reader: _Reader, message: Any) -> None:
        reader.ranges.clear()

    def _erase(self, reader: _Reader, message: Any) -> None:
        refusal = "Logs not erased: armed" if self._armed() else self._source.erase()
        if refusal:
            self._explain(refusal)
            return
        for each in self._readers.values():
            each.files, each.entries, each.ranges = (), deque(), deque()


def _send_ranges(reader: _Reader) -> None:
    """Send on from the first range."""
    number = reader.ranges[0].log
    try:
        with reader.files[number].path.open("rb") as file:
            _send_from(file, reader, number)
    except OSError:
        _send_data(reader, number, reader.ranges[0].start, b"")
        reader.ranges.clear()


def _send_from(file: BinaryIO, reader: _Reader, number: int) -> None:
    for _ in range(MAX_MESSAGES_PER_POLL):
        if not reader.ranges or reader.ranges[0].log != number or reader.room() < _MAX_FRAME_BYTES:
            return
        wanted = reader.ranges[0]
        file.seek(wanted.start)
        data = file.read(min(DATA_BYTES, wanted.stop - wanted.start))
        _send_data(reader, number, wanted.start, data)
        after = wanted.start + len(data)
        if data and after < wanted.stop:
            reader.ranges[0] = wanted._replace(start=after)
        else:
            reader.ranges.popleft()


def _send_data(reader: _Reader, number: int, offset: int, data: bytes) -> None:
    padded = tuple(data.ljust(DATA_BYTES, b"\0"))
    reader.send("LOG_DATA", id=number, ofs=offset, count=len(data), data=padded)
