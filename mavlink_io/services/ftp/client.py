"""Ground's side of MAVLink FTP: lists, checksums and downloads, over a link that may lose any
message."""

from abc import abstractmethod
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, BinaryIO, TypeVar

from mavlink_io.clock import wall_s
from mavlink_io.dialect import enum_names
from mavlink_io.request import Exchange, MavlinkId, Send
from mavlink_io.services.ftp import payload
from mavlink_io.services.ftp.payload import ACK, MAX_DATA, NAK, Packet
from mavlink_io.services.ftp.tree import ListingEntry

T = TypeVar("T")

CRC_TIMEOUT_S = 5.0
"""A vehicle may have to read a large file from a slow disk."""
MAX_REPAIRS = 32
"""How many lost pieces are asked for in one go."""

ProgressCallback = Callable[[int, int], None]
"""Is told how many bytes are there, and of how many."""


class FileClient:
    """Each method begins an exchange, to be fed and polled until it is done."""

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        self._line = send, own, peer
        self._sequences = count(
            int(1000.0 * wall_s())
        )  # a new program must not seem to repeat what the last one asked

    def list(self, path: str) -> Exchange[list[ListingEntry]]:
        """What lies in a directory."""
        return _DirectoryList(*self._line, self._sequences, path)

    def checksum(self, path: str) -> Exchange[int]:
        """The CRC-32 of a file as ``link.files.wire.crc32`` counts it."""
        return _Checksum(*self._line, self._sequences, path)

    def download(
        self, path: str, sink: BinaryIO, start: int = 0, watch: ProgressCallback | None = None
    ) -> Exchange[int]:
        """Append a file to ``sink``, which holds its first ``start`` bytes already; the result is
        the file's size.

        What is written is always the file's beginning without a gap: whoever is interrupted may go
        on from there."""
        return _FtpDownload(*self._line, self._sequences, path, sink, start, watch)


class _Conversation(Exchange[T]):
    """Requests with an answer each."""

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
            self._take(packet)

    @abstractmethod
    def _take(self, packet: Packet) -> None:
        """Take an answer, perhaps to an earlier request."""

    def _request(
        self, opcode: int, offset: int = 0, size: int = 0, data: bytes = b"", session: int = 0
    ) -> Packet:
        """Ask something."""
        packet = Packet(
            next(self._sequences) & 0xFFFF, session, opcode, size or len(data), 0, 0, offset, data
        )
        self._put(packet)
        return packet

    def _put(self, packet: Packet) -> None:
        self._send_to_peer("FILE_TRANSFER_PROTOCOL", target_network=0, payload=packet.encode())

    def _answers(self, packet: Packet) -> bool:
        """Whether this is what the current request waits for."""
        current = self._current
        return packet.requested == current.opcode and packet.sequence == payload.next_sequence(
            current.sequence
        )

    def _refused(self, packet: Packet) -> None:
        error = packet.data[0] if packet.data else payload.FAIL
        reason = (
            enum_names("MAV_FTP_ERR")
            .get(error, f"error {error}")
            .removeprefix("MAV_FTP_ERR_")
            .lower()
        )
        self._fail(f"{self._describe()}: {reason}")

    def _send_request(self) -> None:
        self._put(self._current)


class _DirectoryList(_Conversation[list[ListingEntry]]):
    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, sequences: Iterator[int], path: str
    ) -> None:
        super().__init__(send, own, peer, sequences, path)
        self._lines = 0
        self._entries: list[ListingEntry] = []
        self._current = self._next()

    def _take(self, packet: Packet) -> None:
        if not self._answers(packet):
            return
        if packet.opcode == ACK and packet.data:
            lines = packet.data.split(b"\0")[:-1]
            self._lines += len(lines)
            self._entries += [_entry(line) for line in lines if line[:1] in (b"F", b"D")]
            self._current = self._next()
            self._put(self._current)
            self._note_progress()
        elif packet.opcode == ACK or packet.data[:1] == bytes((payload.END_OF_FILE,)):
            self._finish(self._entries)
        else:
            self._refused(packet)

    def _next(self) -> Packet:
        path = self._path.encode()
        return Packet(
            next(self._sequences) & 0xFFFF, 0, payload.LIST, len(path), 0, 0, self._lines, path
        )

    def _describe(self) -> str:
        return f"the list of {self._path}"


class _Checksum(_Conversation[int]):
    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, sequences: Iterator[int], path: str
    ) -> None:
        super().__init__(send, own, peer, sequences, path, CRC_TIMEOUT_S)
        data = path.encode()
        self._current = Packet(next(sequences) & 0xFFFF, 0, payload.CRC, len(data), 0, 0, 0, data)

    def _take(self, packet: Packet) -> None:
        if not self._answers(packet):
            return
        if packet.opcode == ACK and len(packet.data) >= 4:
            self._finish(int.from_bytes(packet.data[:4], "little"))
        else:
            self._refused(packet)

    def _describe(self) -> str:
        return f"the checksum of {self._path}"


class _FtpDownload(_Conversation[int]):
    """Opens, has bursts sent, asks again for what was lost in them, and closes."""

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        sequences: Iterator[int],
        path: str,
        sink: BinaryIO,
        start: int,
        watch: ProgressCallback | None,
    ) -> None:
        super().__init__(send, own, peer, sequences, path)
        self._sink, self._watch = sink, watch
        self._written = self._frontier = start
        self._held: dict[int, bytes] = {}
        self._session: int | None = None
        self._size = 0
        data = path.encode()
        self._current = Packet(next(sequences) & 0xFFFF, 0, payload.OPEN, len(data), 0, 0, 0, data)

    def _send_request(self) -> None:
        """At the start, and when nothing has come for a while."""
        if self._session is None:
            super()._send_request()
        else:
            self._go_on()

    def _take(self, packet: Packet) -> None:
        if packet.requested == payload.OPEN:
            self._opened(packet)
        elif self._session is None or packet.session != self._session:
            return
        elif packet.requested in (payload.READ, payload.BURST) and packet.opcode == ACK:
            self._arrived(packet)
        elif packet.requested in (payload.READ, payload.BURST):
            self._ended(packet)

    def _opened(self, packet: Packet) -> None:
        if self._session is not None or not self._answers(packet):
            return
        if packet.opcode == NAK:
            self._refused(packet)
            return
        self._session, self._size = packet.session, int.from_bytes(packet.data[:4], "little")
        if self._written > self._size:
            self._fail(
                f"{self._path}: holds {self._size} bytes, fewer than the {self._written} that are"
                " here already"
            )
            return
        self._note_progress()
        self._go_on()

    def _arrived(self, packet: Packet) -> None:
        self._note_progress()
        self._held[packet.offset] = packet.data
        if packet.offset > self._frontier:
            for offset in range(self._frontier, packet.offset, MAX_DATA):
                self._read(offset, min(MAX_DATA, packet.offset - offset))
        self._frontier = max(self._frontier, packet.offset + len(packet.data))
        self._write()
        if self._written >= self._size or (
            packet.requested == payload.BURST and packet.burst_complete
        ):
            self._go_on()

    def _ended(self, packet: Packet) -> None:
        """A burst has come to the end of the file, or something is wrong."""
        error = packet.data[0] if packet.data else payload.FAIL
        if (
            error == payload.INVALID_SESSION
        ):  # the vehicle has begun anew: so do we, from what is there
            self._session = None
            self._current = self._current._replace(sequence=next(self._sequences) & 0xFFFF)
            self._put(self._current)
        elif error != payload.END_OF_FILE:
            self._refused(packet)
        elif packet.requested == payload.BURST:
            self._frontier = self._size
            self._go_on()

    def _go_on(self) -> None:
        """Ask for what was lost and for what is next, or close where nothing is left."""
        if self._written >= self._size:
            self._request(payload.TERMINATE, session=self._session or 0)
            self._finish(self._size)
            return
        for offset, length in self._gaps()[:MAX_REPAIRS]:
            self._read(offset, length)
        if self._frontier < self._size:
            self._request(payload.BURST, self._frontier, MAX_DATA, session=self._session or 0)

    def _read(self, offset: int, length: int) -> None:
        self._request(payload.READ, offset, length, session=self._session or 0)

    def _gaps(self) -> list[tuple[int, int]]:
        """Place and length of every piece that is missing before the frontier."""
        gaps, at = [], self._written
        for offset in (*sorted(self._held), self._frontier):
            gaps += [
                (piece, min(MAX_DATA, offset - piece)) for piece in range(at, offset, MAX_DATA)
            ]
            at = max(at, offset + len(self._held.get(offset, b"")))
        return gaps

    def _write(self) -> None:
        """Append what follows what is there."""
        for offset in sorted(self._held):
            if offset > self._written:
                break
            data = self._held.pop(offset)[self._written - offset :]
            self._sink.write(data)
            self._written += len(data)
        if self._watch is not None:
            self._watch(self._written, self._size)

    def _describe(self) -> str:
        return f"the request for {self._path}"


def _entry(line: bytes) -> ListingEntry:
    name, _, size = line[1:].decode("utf-8", "replace").partition("\t")
    return ListingEntry(name, int(size) if line[:1] == b"F" and size.isdecimal() else None)
