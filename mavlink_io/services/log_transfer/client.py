"""Ground's side of the LOG_* service: what every autopilot understands. It knows no names and no
checksums."""

from collections.abc import Callable
from typing import Any, BinaryIO, NamedTuple

from mavlink_io.request import Exchange, MavlinkId, Send
from mavlink_io.services.log_transfer.server import DATA_BYTES

CHUNK_MESSAGES = 512
"""How many messages are asked for at a time."""
LAST = 0xFFFF

ProgressCallback = Callable[[int, int], None]
"""Is told how many bytes are there, and of how many."""


class RemoteLog(NamedTuple):
    """One log of a vehicle."""

    number: int
    bytes: int
    began_unix_s: int
    """0 where nobody knows."""


class LogClient:
    """Each method begins an exchange, to be fed and polled until it is done."""

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        self._line = send, own, peer

    def list(self) -> Exchange[list[RemoteLog]]:
        """The logs there are, the oldest first."""
        return _LogList(*self._line)

    def download(
        self, log: RemoteLog, sink: BinaryIO, start: int = 0, watch: ProgressCallback | None = None
    ) -> Exchange[int]:
        """Append a log to ``sink``, which holds its first ``start`` bytes already, a multiple of
        90. The result is its size. What is written is always the log's beginning without a gap."""
        return _LogDownload(*self._line, log, sink, start, watch)


class _LogList(Exchange[list[RemoteLog]]):
    message_names = frozenset(("LOG_ENTRY",))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        super().__init__(send, own, peer)
        self._logs: dict[int, RemoteLog] = {}

    def _send_request(self) -> None:
        self._send_to_peer("LOG_REQUEST_LIST", start=0, end=LAST)

    def _handle_message(self, name: str, message: Any) -> None:
        if message.num_logs:
            self._logs[message.id] = RemoteLog(message.id, message.size, message.time_utc)
            self._note_progress()
        if len(self._logs) >= message.num_logs:
            self._finish([self._logs[number] for number in sorted(self._logs)])

    def _describe(self) -> str:
        return "the list of logs"


class _LogDownload(Exchange[int]):
    message_names = frozenset(("LOG_DATA",))

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        log: RemoteLog,
        sink: BinaryIO,
        start: int,
        watch: ProgressCallback | None,
    ) -> None:
        super().__init__(send, own, peer)
        self._log, self._sink, self._watch = log, sink, watch
        self._written = start
        self._held: dict[int, bytes] = {}
        self._asked_to = start

    def _send_request(self) -> None:
        """The first gap, or the next chunk."""
        stop = min(
            [offset for offset in self._held if offset > self._written], default=self._log.bytes
        )
        stop = min(stop, self._written + CHUNK_MESSAGES * DATA_BYTES)
        self._asked_to = max(self._asked_to, stop)
        self._send_to_peer(
            "LOG_REQUEST_DATA", id=self._log.number, ofs=self._written, count=stop - self._written
        )

    def _handle_message(self, name: str, message: Any) -> None:
        if message.id != self._log.number or not message.count:
            return
        self._note_progress()
        if message.ofs >= self._written:
            self._held[message.ofs] = bytes(message.data[: message.count])
        while (data := self._held.pop(self._written, None)) is not None:
            self._sink.write(data)
            self._written += len(data)
        if self._watch is not None:
            self._watch(self._written, self._log.bytes)
        if self._written >= self._log.bytes:
            self._send_to_peer("LOG_REQUEST_END")
            self._finish(self._log.bytes)
        elif message.ofs + message.count >= self._asked_to:
            self._send_request()

    def _describe(self) -> str:
        return f"the request for log {self._log.number}"
