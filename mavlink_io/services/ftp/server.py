"""The vehicle's side of MAVLink FTP: reads, lists and checksums, for several clients at once.

Every request is answered, the impossible ones at once. A request that comes again is given the
answer that it was given before. Bursts and checksums are done a little at a time: nobody else has
to wait for them."""

import struct
from collections.abc import Callable
from typing import NamedTuple

from mavlink_io import dialect
from mavlink_io.codec import Frame, largest_frame
from mavlink_io.request import Client, MavlinkId, RoomBytes, Send
from mavlink_io.services.ftp import payload as wire
from mavlink_io.services.ftp.payload import ACK, MAX_DATA, NAK, Packet
from mavlink_io.services.ftp.tree import FileTree, ListingEntry, OpenFile

BURST_PACKETS = 256
"""After so many the client has to ask again: one that is gone is not sent a whole file."""
MAX_SESSIONS = 16
SESSION_IDLE_S = 120.0
"""A session that was not used for longer may be closed: its client is gone."""
CRC_BYTES = 1_000_000
"""How much of a file is checksummed in one go."""

_MAX_SIZE = 0xFFFF_FFFF
_MAX_FRAME_BYTES = largest_frame(dialect.by_name("FILE_TRANSFER_PROTOCOL"))
_size = struct.Struct("<I")


class _FtpSession(NamedTuple):
    file: OpenFile
    used_s: float


class _FtpJob(NamedTuple):
    """What takes several polls: a burst, or a checksum."""

    request: Packet
    room: RoomBytes
    file: OpenFile
    offset: int
    done: int = 0
    """Packets that were sent, or the checksum so far."""


class _RefusedError(Exception):
    """A request that is answered with a MAV_FTP_ERR."""

    def __init__(self, error: int) -> None:
        self.error = error


class FileServer:
    """Serves a tree of files. Sessions belong to who opened them; two clients may use the same
    session number."""

    message_names = frozenset(("FILE_TRANSFER_PROTOCOL",))

    def __init__(self, tree: FileTree) -> None:
        self.tree = tree
        self._sessions: dict[tuple[Client, int], _FtpSession] = {}
        self._answered: dict[Client, tuple[bytes, bytes]] = {}
        self._jobs: dict[Client, _FtpJob] = {}
        self._now_s = 0.0
        self._handlers: dict[int, Callable[[Client, Packet], bytes]] = {
            wire.NONE: lambda client, request: b"",
            wire.TERMINATE: self._terminate,
            wire.RESET: self._reset,
            wire.LIST: self._list,
            wire.OPEN: self._open,
            wire.READ: self._read,
        }

    def feed(self, frame: Frame, send: Send, room: RoomBytes, now_s: float) -> None:
        """Serve one request that is addressed to this vehicle; ``send`` and ``room`` are of the
        link it came by."""
        self._now_s = now_s
        payload = bytes(frame.decode().payload)
        client, request = (
            Client(MavlinkId(frame.system, frame.component), send),
            wire.decode(payload),
        )
        if request.opcode in (ACK, NAK):
            return
        asked, answered = self._answered.get(client, (b"", b""))
        if asked == payload:
            if answered:
                _send_packet(client, answered)
            if answered or client in self._jobs:
                return
        answer = self._serve(client, request, room)
        self._answered[client] = payload, b"" if answer is None else answer.encode()
        if answer is not None:
            _send_packet(client, answer.encode())

    def poll(self, now_s: float) -> None:
        """Go on with bursts and checksums, as far as their links have room."""
        self._now_s = now_s
        for client, job in list(self._jobs.items()):
            try:
                left = (
                    self._burst_on(client, job)
                    if job.request.opcode == wire.BURST
                    else self._crc_on(client, job)
                )
            except OSError:
                _release(job)
                _send_packet(client, _refuse(job.request, wire.FAIL).encode())
                left = None
            if left is None:
                del self._jobs[client]
            else:
                self._jobs[client] = left

    def _serve(self, client: Client, request: Packet, room: RoomBytes) -> Packet | None:
        """The answer to a request; None where it follows later."""
        try:
            if request.size > MAX_DATA:
                raise _RefusedError(wire.INVALID_SIZE)
            if request.opcode in (wire.BURST, wire.CRC):
                self._jobs[client] = self._begin(client, request, room)
                return None
            handler = self._handlers.get(request.opcode)
            if handler is None:
                raise _RefusedError(
                    wire.PROTECTED if request.opcode in wire.WRITE_OPCODES else wire.UNKNOWN_COMMAND
                )
            return _answer(request, handler(client, request))
        except _RefusedError as refusal:
            return _refuse(request, refusal.error)
        except FileNotFoundError:
            return _refuse(request, wire.NOT_FOUND)
        except OSError:
            return _refuse(request, wire.FAIL)

    def _terminate(self, client: Client, request: Packet) -> bytes:
        """Granted where nothing is open, too: the client only wants it closed."""
        self._close((client, request.session))
        return b""

    def _reset(self, client: Client, request: Packet) -> bytes:
        """Closes what this client has open; others go on."""
        for key in [key for key in self._sessions if key[0] == client]:
            self._close(key)
        return b""

    def _list(self, client: Client, request: Packet) -> bytes:
        lines = [_line(entry) for entry in self.tree.entries(_path(request))[request.offset :]]
        if not lines:
            raise _RefusedError(wire.END_OF_FILE)
        fitting = b""
        for line in lines:
            if len(fitting) + len(line) > MAX_DATA:
                break
            fitting += line
        return fitting or b"S\0"

    def _open(self, client: Client, request: Packet) -> bytes:
        """The session is the one that the client asked for: some ignore which they are given."""
        key = client, request.session
        self._close(key)
        if len(self._sessions) >= MAX_SESSIONS:
            self._forget_idle()
        file = self.tree.open(_path(request))
        self._sessions[key] = _FtpSession(file, self._now_s)
        return _size.pack(min(file.size, _MAX_SIZE))

    def _read(self, client: Client, request: Packet) -> bytes:
        file = self._session(client, request.session)
        data = file.read(request.offset, request.size or MAX_DATA)
        if not data:
            raise _RefusedError(wire.END_OF_FILE)
        return data

    def _begin(self, client: Client, request: Packet, room: RoomBytes) -> _FtpJob:
        """A job in place of the client's last one."""
        if old := self._jobs.pop(client, None):
            _release(old)
        if request.opcode == wire.CRC:
            return _FtpJob(request, room, self.tree.open(_path(request)), 0)
        return _FtpJob(request, room, self._session(client, request.session), request.offset)

    def _burst_on(self, client: Client, job: _FtpJob) -> _FtpJob | None:
        length = job.request.size or MAX_DATA
        while job.room() >= _MAX_FRAME_BYTES:
            data = job.file.read(job.offset, length)
            sequence = (job.request.sequence + 1 + job.done) & 0xFFFF
            if not data:
                end = _refuse(job.request._replace(offset=job.offset), wire.END_OF_FILE)
                _send_packet(client, end._replace(sequence=sequence).encode())
                return None
            last = job.done + 1 == BURST_PACKETS
            packet = _answer(job.request, data)._replace(
                sequence=sequence, offset=job.offset, burst_complete=int(last)
            )
            _send_packet(client, packet.encode())
            if last:
                return None
            job = job._replace(offset=job.offset + len(data), done=job.done + 1)
        return job

    def _crc_on(self, client: Client, job: _FtpJob) -> _FtpJob | None:
        data = job.file.read(job.offset, CRC_BYTES)
        if data:
            return job._replace(offset=job.offset + len(data), done=wire.crc32(data, job.done))
        job.file.close()
        answer = _answer(job.request, _size.pack(job.done)).encode()
        self._answered[client] = job.request.encode(), answer
        _send_packet(client, answer)
        return None

    def _session(self, client: Client, number: int) -> OpenFile:
        session = self._sessions.get((client, number))
        if session is None:
            raise _RefusedError(wire.INVALID_SESSION)
        self._sessions[client, number] = session._replace(used_s=self._now_s)
        return session.file

    def _close(self, key: tuple[Client, int]) -> None:
        session = self._sessions.pop(key, None)
        if session is None:
            return
        job = self._jobs.get(key[0])
        if job is not None and job.file is session.file:
            del self._jobs[key[0]]
        session.file.close()

    def _forget_idle(self) -> None:
        """Make room for a session. Raises _RefusedError where all are in use."""
        idle = [
            key
            for key, session in self._sessions.items()
            if self._now_s - session.used_s > SESSION_IDLE_S
        ]
        if not idle:
            raise _RefusedError(wire.NO_SESSIONS)
        for key in idle:
            self._close(key)


def _release(job: _FtpJob) -> None:
    """A checksum has a file of its own; a burst's belongs to its session."""
    if job.request.opcode == wire.CRC:
        job.file.close()


def _path(request: Packet) -> str:
    """The path in a request. Raises FileNotFoundError for what is no text."""
    try:
        return request.data.split(b"\0", 1)[0].decode()
    except UnicodeDecodeError:
        raise FileNotFoundError(repr(request.data)) from None


def _line(entry: ListingEntry) -> bytes:
    """One entry of a listing; one whose name is too long for any message is skipped."""
    text = f"D{entry.name}" if entry.size is None else f"F{entry.name}\t{entry.size}"
    line = text.encode() + b"\0"
    return line if len(line) <= MAX_DATA else b"S\0"


def _answer(request: Packet, data: bytes) -> Packet:
    sequence = wire.next_sequence(request.sequence)
    return Packet(
        sequence, request.session, ACK, len(data), request.opcode, 0, request.offset, data
    )


def _refuse(request: Packet, error: int) -> Packet:
    sequence = wire.next_sequence(request.sequence)
    return Packet(
        sequence, request.session, NAK, 1, request.opcode, 0, request.offset, bytes((error,))
    )


def _send_packet(client: Client, payload: bytes) -> None:
    client.send(
        "FILE_TRANSFER_PROTOCOL",
        target_network=0,
        target_system=client.mavlink_id.system,
        target_component=client.mavlink_id.component,
        payload=payload,
    )
