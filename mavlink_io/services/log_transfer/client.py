"""The ground's side of the LOG_* messages, which every autopilot supports.

The messages carry no file names and no checksums. Source:
https://mavlink.io/en/messages/common.html#LOG_REQUEST_LIST.
"""

from collections.abc import Callable
from typing import Any, BinaryIO, NamedTuple

from mavlink_io.request import Exchange, MavlinkId, Send
from mavlink_io.services.log_transfer.server import DATA_BYTES
from mavlink_io.services.ordered_pieces import OrderedPieces

CHUNK_MESSAGES = 512
"""Number of LOG_DATA messages that one request asks for."""
LAST = 0xFFFF
"""LOG_REQUEST_LIST.end for all logs."""

ProgressCallback = Callable[[int, int], None]
"""Receive the number of bytes written so far and the size of the log."""


class RemoteLog(NamedTuple):
    """One log of a vehicle."""

    number: int
    """Number of the log in the vehicle's list."""
    bytes: int
    """Size of the log."""
    began_unix_s: int
    """UNIX time of the beginning of the log, in seconds; 0 if unknown."""


class LogClient:
    """Client of the LOG_* messages; each method returns an exchange that has not started.

    Feed and poll the exchange until it is done (``request.run``).

    Parameters
    ----------
    send : Send
        Function that sends a message to the vehicle.
    own, peer : MavlinkId
        Ids of this program and of the vehicle.
    """

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        self._participants = send, own, peer

    def list(self) -> Exchange[list[RemoteLog]]:
        """List the vehicle's logs.

        Returns
        -------
        Exchange
            Its result is the list of logs by number, the oldest first.
        """
        return _LogList(*self._participants)

    def download(
        self,
        log: RemoteLog,
        sink: BinaryIO,
        start: int = 0,
        on_progress: ProgressCallback | None = None,
    ) -> Exchange[int]:
        """Append a log, or the rest of it, to a local file.

        Parameters
        ----------
        log : RemoteLog
            A log of the list.
        sink : binary file
            Local file. The bytes in it are at any time the beginning of the log without gaps.
        start : int
            Number of bytes of the log that ``sink`` contains already, a multiple of 90.
        on_progress : callable, optional
            Receive the progress.

        Returns
        -------
        Exchange
            Its result is the size of the log in bytes.
        """
        return _LogDownload(*self._participants, log, sink, start, on_progress)


class _LogList(Exchange[list[RemoteLog]]):
    """Request the list until an entry of every log has arrived."""

    message_names = frozenset(("LOG_ENTRY",))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        super().__init__(send, own, peer)
        self._logs: dict[int, RemoteLog] = {}

    def _send_request(self) -> None:
        self._send_to_peer("LOG_REQUEST_LIST", start=0, end=LAST)

    def _handle_message(self, name: str, message: Any) -> None:
        """Add a LOG_ENTRY; finish when all logs are listed."""
        if message.num_logs:
            self._note_progress(is_new=message.id not in self._logs)
            self._logs[message.id] = RemoteLog(message.id, message.size, message.time_utc)
        if len(self._logs) >= message.num_logs:
            self._finish([self._logs[number] for number in sorted(self._logs)])

    def _describe(self) -> str:
        return "the list of logs"


class _LogDownload(Exchange[int]):
    """Request the log in chunks, and lost pieces again."""

    message_names = frozenset(("LOG_DATA",))

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        log: RemoteLog,
        sink: BinaryIO,
        start: int,
        on_progress: ProgressCallback | None,
    ) -> None:
        super().__init__(send, own, peer)
        self._log, self._on_progress = log, on_progress
        self._pieces = OrderedPieces(sink, start)
        self._requested_end = start

    def _send_request(self) -> None:
        """Request the first gap or the next chunk."""
        stop = min(
            [offset for offset in self._pieces.pending if offset > self._pieces.written],
            default=self._log.bytes,
        )
        stop = min(stop, self._pieces.written + CHUNK_MESSAGES * DATA_BYTES)
        self._requested_end = max(self._requested_end, stop)
        self._send_to_peer(
            "LOG_REQUEST_DATA",
            id=self._log.number,
            ofs=self._pieces.written,
            count=stop - self._pieces.written,
        )

    def _handle_message(self, name: str, message: Any) -> None:
        """Write the data of a LOG_DATA in order; finish at the size of the log.

        Bytes that were not requested are ignored.
        """
        data = bytes(message.data[: message.count])[: max(0, self._log.bytes - message.ofs)]
        if message.id != self._log.number or not data or message.ofs >= self._requested_end:
            return
        self._note_progress(is_new=self._pieces.add(message.ofs, data))
        if self._on_progress is not None:
            self._on_progress(self._pieces.written, self._log.bytes)
        if self._pieces.written >= self._log.bytes:
            self._send_to_peer("LOG_REQUEST_END")
            self._finish(self._log.bytes)
        elif message.ofs + message.count >= self._requested_end:
            self._send_request()

    def _describe(self) -> str:
        return f"the request for log {self._log.number}"
