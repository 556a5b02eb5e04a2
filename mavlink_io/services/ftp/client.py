"""The ground's side of MAVLink FTP: lists, checksums and downloads over a lossy link."""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, BinaryIO, TypeVar

from mavlink_io.clock import wall_s
from mavlink_io.dialect import enum_names
from mavlink_io.request import Exchange, MavlinkId, Send
from mavlink_io.services.ftp import payload
from mavlink_io.services.ftp.payload import ACK, MAX_DATA, NAK, Packet
from mavlink_io.services.ftp.tree import ListingEntry
from mavlink_io.services.ordered_pieces import OrderedPieces

T = TypeVar("T")

CRC_TIMEOUT_S = 5.0
"""Wall time before a checksum request is repeated, in seconds: the vehicle reads the whole file."""
MAX_REPAIRS = 32
"""Maximum number of lost pieces that are requested at once."""
MAX_BURST = 0x7FFF
"""Maximum number of packets of a burst; numbers further ahead are of requests before it."""
MAX_ENTRIES = 10_000
"""Maximum number of entries of a directory: a vehicle that ignores the offset of a request repeats
its first ones for ever."""
MAX_REQUESTS = 256
"""Number of the last requests whose answers count: more than can be under way."""

ProgressCallback = Callable[[int, int], None]
"""Receive the number of bytes written so far and the size of the file."""


class FileClient:
    """Client of MAVLink FTP; each method returns an exchange that has not started.

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
        # from the clock: a new program must not seem to repeat the last program's requests
        self._sequences = count(int(1000.0 * wall_s()))

    def list(self, path: str) -> Exchange[list[ListingEntry]]:
        """List a directory.

        Parameters
        ----------
        path : str
            Path of the directory on the vehicle.

        Returns
        -------
        Exchange
            Its result is the list of entries.
        """
        return _DirectoryList(*self._participants, self._sequences, path)

    def checksum(self, path: str) -> Exchange[int]:
        """Compute the checksum of a file on the vehicle.

        Parameters
        ----------
        path : str
            Path of the file on the vehicle.

        Returns
        -------
        Exchange
            Its result is the CRC-32 of the file as ``payload.crc32`` computes it.
        """
        return _Checksum(*self._participants, self._sequences, path)

    def download(
        self, path: str, sink: BinaryIO, start: int = 0, on_progress: ProgressCallback | None = None
    ) -> Exchange[int]:
        """Append a file, or the rest of it, to a local file.

        Parameters
        ----------
        path : str
            Path of the file on the vehicle.
        sink : binary file
            Local file. The bytes in it are at any time the beginning of the remote file without
            gaps, so that an interrupted download can be resumed.
        start : int
            Number of bytes of the remote file that ``sink`` contains already.
        on_progress : callable, optional
            Receive the progress.

        Returns
        -------
        Exchange
            Its result is the size of the file in bytes.
        """
        return _FtpDownload(*self._participants, self._sequences, path, sink, start, on_progress)


class _FtpExchange(Exchange[T]):
    """Send FTP requests and process their answers."""

    message_names = frozenset(("FILE_TRANSFER_PROTOCOL",))

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        sequences: Iterator[int],
        path: str,
        retry_s: float = 1.0,
    ) -> None:
        super().__init__(send, own, peer, retry_s=retry_s)
        self._sequences, self._path = sequences, path
        self._current = Packet(0, 0, payload.NONE)
        if len(path.encode()) > MAX_DATA:
            self._fail(f"{path}: is longer than the {MAX_DATA} bytes that a request can hold")

    def _handle_message(self, name: str, message: Any) -> None:
        packet = payload.decode(bytes(message.payload))
        if packet.opcode in (ACK, NAK):
            self._handle_answer(packet)

    @abstractmethod
    def _handle_answer(self, packet: Packet) -> None:
        """Process an answer, which may belong to an earlier request."""

    def _request(
        self, opcode: int, offset: int = 0, size: int = 0, data: bytes = b"", session: int = 0
    ) -> Packet:
        """Send a new request and return it."""
        packet = Packet(
            sequence=next(self._sequences) & 0xFFFF,
            session=session,
            opcode=opcode,
            size=size or len(data),
            offset=offset,
            data=data,
        )
        self._send_packet(packet)
        return packet

    def _send_packet(self, packet: Packet) -> None:
        """Send a request."""
        self._send_to_peer("FILE_TRANSFER_PROTOCOL", target_network=0, payload=packet.encode())

    def _is_current_answer(self, packet: Packet) -> bool:
        """Return whether an answer belongs to the current request."""
        current = self._current
        return packet.requested == current.opcode and packet.sequence == payload.next_sequence(
            current.sequence
        )

    def _fail_with_error(self, packet: Packet) -> None:
        """End the exchange with the error in an answer."""
        error = packet.data[0] if packet.data else payload.FAIL
        reason = (
            enum_names("MAV_FTP_ERR")
            .get(error, f"error {error}")
            .removeprefix("MAV_FTP_ERR_")
            .lower()
        )
        self._fail(f"{self._describe()}: {reason}")

    def _send_request(self) -> None:
        self._send_packet(self._current)


class _DirectoryList(_FtpExchange[list[ListingEntry]]):
    """Request parts of a listing until the vehicle reports its end."""

    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, sequences: Iterator[int], path: str
    ) -> None:
        super().__init__(send, own, peer, sequences, path)
        self._line_count = 0
        self._entries: list[ListingEntry] = []
        self._current = self._next_request()

    def _handle_answer(self, packet: Packet) -> None:
        """Add the entries of an answer and request the next ones, until the end of the list."""
        if not self._is_current_answer(packet):
            return
        if packet.opcode == ACK and packet.data:
            lines = packet.data.split(b"\0")[:-1]
            if not lines:  # the next request would be the same one
                self._fail(f"{self._describe()}: the answer has no complete entry")
                return
            self._line_count += len(lines)
            if self._line_count > MAX_ENTRIES:
                self._fail(f"{self._describe()}: has more than {MAX_ENTRIES} entries")
                return
            self._entries += [_entry(line) for line in lines if line[:1] in (b"F", b"D")]
            self._current = self._next_request()
            self._send_packet(self._current)
            self._note_progress()
        elif packet.opcode == ACK or packet.data[:1] == bytes((payload.END_OF_FILE,)):
            self._finish(self._entries)
        else:
            self._fail_with_error(packet)

    def _next_request(self) -> Packet:
        """Return the request for the entries after the received ones."""
        path = self._path.encode()
        return Packet(
            sequence=next(self._sequences) & 0xFFFF,
            session=0,
            opcode=payload.LIST,
            size=len(path),
            offset=self._line_count,
            data=path,
        )

    def _describe(self) -> str:
        return f"the list of {self._path}"


class _Checksum(_FtpExchange[int]):
    """Request a checksum."""

    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, sequences: Iterator[int], path: str
    ) -> None:
        super().__init__(send, own, peer, sequences, path, CRC_TIMEOUT_S)
        self._current = _path_request(sequences, payload.CRC, path)

    def _handle_answer(self, packet: Packet) -> None:
        """Finish with the CRC-32 of an answer."""
        if not self._is_current_answer(packet):
            return
        if packet.opcode == ACK and len(packet.data) >= 4:
            self._finish(int.from_bytes(packet.data[:4], "little"))
        else:
            self._fail_with_error(packet)

    def _describe(self) -> str:
        return f"the checksum of {self._path}"


class _FtpDownload(_FtpExchange[int]):
    """Open a file, request bursts, request lost pieces again, and close the file.

    ``_frontier`` is the end of the last byte that was received or requested. What ``_pieces`` has
    neither written nor pending before it is lost.
    """

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        sequences: Iterator[int],
        path: str,
        sink: BinaryIO,
        start: int,
        on_progress: ProgressCallback | None,
    ) -> None:
        super().__init__(send, own, peer, sequences, path)
        self._on_progress, self._frontier = on_progress, start
        self._pieces = OrderedPieces(sink, start)
        self._requests: deque[Packet] = deque(maxlen=MAX_REQUESTS)
        self._session: int | None = None
        self._size, self._opened_at = 0, -1
        self._current = _path_request(sequences, payload.OPEN, path)

    def _send_request(self) -> None:
        """Open the file, or request the rest after a silence."""
        if self._session is None:
            super()._send_request()
        else:
            self._request_rest()

    def _handle_answer(self, packet: Packet) -> None:
        """Handle an answer to the open, read or burst request of this download."""
        if packet.requested == payload.OPEN:
            self._handle_open(packet)
        elif self._session is None or packet.session != self._session:
            return
        elif packet.requested in (payload.READ, payload.BURST) and packet.opcode == ACK:
            self._handle_data(packet)
        elif packet.requested in (payload.READ, payload.BURST):
            self._handle_read_error(packet)

    def _handle_open(self, packet: Packet) -> None:
        """Process the answer to the request to open the file."""
        if self._session is not None or not self._is_current_answer(packet):
            return
        if packet.opcode == NAK:
            self._fail_with_error(packet)
            return
        self._session, self._size = packet.session, int.from_bytes(packet.data[:4], "little")
        if self._pieces.written > self._size:
            self._fail(
                f"{self._path}: holds {self._size} bytes, fewer than the {self._pieces.written}"
                " that are here already"
            )
            return
        self._note_progress(is_new=self._pieces.written > self._opened_at)
        self._opened_at = self._pieces.written
        self._request_rest()

    def _handle_data(self, packet: Packet) -> None:
        """Process bytes of the file and request the pieces that were lost before them.

        Bytes that no request explains are ignored: they are late ones of an earlier transfer, whose
        session may have had the same number. So are bytes after the end: the file has grown.
        """
        if packet.offset >= self._size or not packet.data or not self._is_requested(packet):
            return
        data = packet.data[: self._size - packet.offset]
        self._note_progress(is_new=self._pieces.add(packet.offset, data))
        lost = range(self._frontier, packet.offset, MAX_DATA)
        for offset in lost[:MAX_REPAIRS]:  # the end of the burst requests the others
            self._read(offset, min(MAX_DATA, packet.offset - offset))
        self._frontier = max(self._frontier, packet.offset + len(packet.data))
        if self._on_progress is not None:
            self._on_progress(self._pieces.written, self._size)
        if self._pieces.written >= self._size or (
            packet.requested == payload.BURST and packet.burst_complete
        ):
            self._request_rest()

    def _is_requested(self, packet: Packet) -> bool:
        """Return whether data answer a request, by their number and their place in the file.

        Each packet of a burst has as many bytes as the others, fewer than requested if the vehicle
        chooses so; the packet with the end of the file has fewer.
        """
        is_last = packet.offset + len(packet.data) >= self._size
        for request, number in self._numbered(packet):
            ahead = packet.offset - request.offset
            if ahead == number * len(packet.data):
                return True
            if is_last and number <= ahead <= number * request.size:
                return True
        return False

    def _numbered(self, packet: Packet) -> Iterator[tuple[Packet, int]]:
        """Yield the requests that an answer can belong to, and its number in each answer.

        Packet k of a burst, from 0, has the number of the request plus 1 + k.
        Source: https://mavlink.io/en/services/ftp.html.
        """
        for request in self._requests:
            number = packet.sequence - payload.next_sequence(request.sequence) & 0xFFFF
            largest = MAX_BURST if request.opcode == payload.BURST else 0
            if request.opcode == packet.requested and number <= largest:
                yield request, number

    def _handle_read_error(self, packet: Packet) -> None:
        """Process the end of a burst at the end of the file, or an error; ignore late ones."""
        requests = list(self._numbered(packet))
        if not requests:
            return
        error = packet.data[0] if packet.data else payload.FAIL
        if error == payload.INVALID_SESSION:  # the vehicle has restarted: open the file again
            self._session = None
            self._current = self._current._replace(sequence=next(self._sequences) & 0xFFFF)
            self._send_packet(self._current)
        elif error != payload.END_OF_FILE:
            self._fail_with_error(packet)
        elif packet.requested == payload.BURST and any(
            # with fewer packets the burst has not reached the end: an earlier transfer has
            request.offset + number * request.size >= self._size
            for request, number in requests
        ):
            self._frontier = self._size
            self._request_rest()

    def _request_rest(self) -> None:
        """Request lost pieces and the next burst; close the file if it is complete."""
        if self._pieces.written >= self._size:
            self._request(payload.TERMINATE, session=self._session or 0)
            self._finish(self._size)
            return
        for offset, length in self._gaps()[:MAX_REPAIRS]:
            self._read(offset, length)
        if self._frontier < self._size:
            self._request_data(payload.BURST, self._frontier, MAX_DATA)

    def _read(self, offset: int, length: int) -> None:
        """Request one piece."""
        self._request_data(payload.READ, offset, length)

    def _request_data(self, opcode: int, offset: int, length: int) -> None:
        """Request bytes of the file, and keep the request to recognise the answers."""
        request = self._request(opcode, offset, length, session=self._session or 0)
        self._requests.append(request)

    def _gaps(self) -> list[tuple[int, int]]:
        """Return offset and length of every piece that is missing before the frontier."""
        gaps, end = [], self._pieces.written
        for offset in (*sorted(self._pieces.pending), self._frontier):
            gaps += [
                (piece, min(MAX_DATA, offset - piece)) for piece in range(end, offset, MAX_DATA)
            ]
            end = max(end, offset + len(self._pieces.pending.get(offset, b"")))
        return gaps

    def _describe(self) -> str:
        return f"the request for {self._path}"


def _path_request(sequences: Iterator[int], opcode: int, path: str) -> Packet:
    """Return a request whose data is a path."""
    data = path.encode()
    return Packet(
        sequence=next(sequences) & 0xFFFF, session=0, opcode=opcode, size=len(data), data=data
    )


def _entry(line: bytes) -> ListingEntry:
    """Return one entry of a listing."""
    name, _, size = line[1:].decode("utf-8", "replace").partition("\t")
    return ListingEntry(name, int(size) if line[:1] == b"F" and size.isdecimal() else None)
