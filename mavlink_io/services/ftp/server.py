"""The vehicle's side of MAVLink FTP: reads, lists and checksums, for several clients at once.

Every request is answered; a repeated request gets the same answer again. Bursts and checksums are
done in small steps, so that they do not delay other work.
"""

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
"""Maximum number of packets per burst request, so that a lost client does not get a whole file."""
MAX_SESSIONS = 16
"""Maximum number of open files of all clients."""
SESSION_IDLE_S = 120.0
"""Wall time without use after which a session may be closed for a new one, in seconds."""
CRC_BYTES = 1_000_000
"""Number of bytes of a file that one poll adds to a checksum."""

_MAX_SIZE = 0xFFFF_FFFF
_MAX_FRAME_BYTES = largest_frame(dialect.by_name("FILE_TRANSFER_PROTOCOL"))
_size = struct.Struct("<I")


class _FtpSession(NamedTuple):
    """An open file and the wall time of its last use."""

    file: OpenFile
    used_s: float


class _FtpJob(NamedTuple):
    """A request that takes several polls: a burst or a checksum."""

    request: Packet
    room: RoomBytes
    file: OpenFile
    offset: int
    """Position of the next byte to read."""
    progress: int = 0
    """Number of sent packets of a burst, or checksum of the bytes before ``offset``."""


class _RequestRefused(Exception):  # noqa: N818 - an answer of the protocol, not a program error
    """The request is answered with a MAV_FTP_ERR."""

    def __init__(self, error: int) -> None:
        self.error = error


class FileServer:
    """Server of MAVLink FTP for a read-only tree of files.

    A session belongs to the client that opened it; two clients may use the same session number.

    Parameters
    ----------
    tree : FileTree
        The files to serve.
    """

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
        """Process one request that is addressed to this vehicle.

        Parameters
        ----------
        frame : Frame
            A FILE_TRANSFER_PROTOCOL.
        send : Send
            Function that sends on the frame's link: the same object for every frame of a link.
        room : RoomBytes
            Return how many bytes of bulk data the frame's link accepts now.
        now_s : float
            Wall clock, in seconds.
        """
        self._now_s = now_s
        payload = bytes(frame.decode().payload)
        client, request = (
            Client(MavlinkId(frame.system, frame.component), send),
            wire.decode(payload),
        )
        if request.opcode in (ACK, NAK):
            return
        last_request, last_answer = self._answered.get(client, (b"", b""))
        if last_request == payload:
            if last_answer:
                _send_packet(client, last_answer)
            if last_answer or client in self._jobs:
                return
        answer = self._serve(client, request, room)
        self._answered[client] = payload, b"" if answer is None else answer.encode()
        if answer is not None:
            _send_packet(client, answer.encode())

    def poll(self, now_s: float) -> None:
        """Continue bursts and checksums, as far as their links have room.

        Parameters
        ----------
        now_s : float
            Wall clock, in seconds.
        """
        self._now_s = now_s
        for client, job in list(self._jobs.items()):
            try:
                rest = (
                    self._continue_burst(client, job)
                    if job.request.opcode == wire.BURST
                    else self._continue_checksum(client, job)
                )
            except OSError:
                _release(job)
                _send_packet(client, _nak(job.request, wire.FAIL).encode())
                rest = None
            if rest is None:
                del self._jobs[client]
            else:
                self._jobs[client] = rest

    def _serve(self, client: Client, request: Packet, room: RoomBytes) -> Packet | None:
        """Return the answer to a request; None if a job will answer it."""
        try:
            if request.size > MAX_DATA:
                raise _RequestRefused(wire.INVALID_SIZE)
            if request.opcode in (wire.BURST, wire.CRC):
                self._jobs[client] = self._begin_job(client, request, room)
                return None
            handler = self._handlers.get(request.opcode)
            if handler is None:
                raise _RequestRefused(
                    wire.PROTECTED if request.opcode in wire.WRITE_OPCODES else wire.UNKNOWN_COMMAND
                )
            return _ack(request, handler(client, request))
        except _RequestRefused as refusal:
            return _nak(request, refusal.error)
        except FileNotFoundError:
            return _nak(request, wire.NOT_FOUND)
        except OSError:
            return _nak(request, wire.FAIL)

    def _terminate(self, client: Client, request: Packet) -> bytes:
        """Close a session; an unknown session is no error."""
        self._close((client, request.session))
        return b""

    def _reset(self, client: Client, request: Packet) -> bytes:
        """Close all sessions of this client."""
        for key in [key for key in self._sessions if key[0] == client]:
            self._close(key)
        return b""

    def _list(self, client: Client, request: Packet) -> bytes:
        """Return as many directory entries from the offset on as fit into one packet."""
        lines = [_line(entry) for entry in self.tree.entries(_path(request))[request.offset :]]
        if not lines:
            raise _RequestRefused(wire.END_OF_FILE)
        data = b""
        for line in lines:
            if len(data) + len(line) > MAX_DATA:
                break
            data += line
        return data or b"S\0"

    def _open(self, client: Client, request: Packet) -> bytes:
        """Open a file and return its size.

        The session has the number in the request, because some clients ignore the answer's.
        """
        key = client, request.session
        self._close(key)
        if len(self._sessions) >= MAX_SESSIONS:
            self._close_idle_sessions()
        file = self.tree.open(_path(request))
        self._sessions[key] = _FtpSession(file, self._now_s)
        return _size.pack(min(file.size, _MAX_SIZE))

    def _read(self, client: Client, request: Packet) -> bytes:
        """Return bytes of an open file."""
        file = self._session_file(client, request.session)
        data = file.read(request.offset, request.size or MAX_DATA)
        if not data:
            raise _RequestRefused(wire.END_OF_FILE)
        return data

    def _begin_job(self, client: Client, request: Packet, room: RoomBytes) -> _FtpJob:
        """Return a new job, after releasing the client's last one."""
        if old := self._jobs.pop(client, None):
            _release(old)
        if request.opcode == wire.CRC:
            return _FtpJob(
                request=request, room=room, file=self.tree.open(_path(request)), offset=0
            )
        return _FtpJob(
            request=request,
            room=room,
            file=self._session_file(client, request.session),
            offset=request.offset,
        )

    def _continue_burst(self, client: Client, job: _FtpJob) -> _FtpJob | None:
        """Send packets while the link has room; return the rest of the job, None at the end."""
        length = job.request.size or MAX_DATA
        while job.room() >= _MAX_FRAME_BYTES:
            data = job.file.read(job.offset, length)
            sequence = (job.request.sequence + 1 + job.progress) & 0xFFFF
            if not data:
                end = _nak(job.request._replace(offset=job.offset), wire.END_OF_FILE)
                _send_packet(client, end._replace(sequence=sequence).encode())
                return None
            is_last = job.progress + 1 == BURST_PACKETS
            packet = _ack(job.request, data)._replace(
                sequence=sequence, offset=job.offset, burst_complete=int(is_last)
            )
            _send_packet(client, packet.encode())
            if is_last:
                return None
            job = job._replace(offset=job.offset + len(data), progress=job.progress + 1)
        return job

    def _continue_checksum(self, client: Client, job: _FtpJob) -> _FtpJob | None:
        """Add bytes to a checksum; return the rest of the job, None after the answer."""
        data = job.file.read(job.offset, CRC_BYTES)
        if data:
            crc = wire.crc32(data, job.progress)
            return job._replace(offset=job.offset + len(data), progress=crc)
        job.file.close()
        answer = _ack(job.request, _size.pack(job.progress)).encode()
        self._answered[client] = job.request.encode(), answer
        _send_packet(client, answer)
        return None

    def _session_file(self, client: Client, number: int) -> OpenFile:
        """Return the open file of a session and note its use."""
        session = self._sessions.get((client, number))
        if session is None:
            raise _RequestRefused(wire.INVALID_SESSION)
        self._sessions[client, number] = session._replace(used_s=self._now_s)
        return session.file

    def _close(self, key: tuple[Client, int]) -> None:
        """Close a session and end a burst from its file; ignore an unknown session."""
        session = self._sessions.pop(key, None)
        if session is None:
            return
        job = self._jobs.get(key[0])
        if job is not None and job.file is session.file:
            del self._jobs[key[0]]
        session.file.close()

    def _close_idle_sessions(self) -> None:
        """Close all idle sessions. Raises _RequestRefused if there is none."""
        idle = [
            key
            for key, session in self._sessions.items()
            if self._now_s - session.used_s > SESSION_IDLE_S
        ]
        if not idle:
            raise _RequestRefused(wire.NO_SESSIONS)
        for key in idle:
            self._close(key)


def _release(job: _FtpJob) -> None:
    """Close the file of a checksum; the file of a burst belongs to its session."""
    if job.request.opcode == wire.CRC:
        job.file.close()


def _path(request: Packet) -> str:
    """Return the path in a request. Raises FileNotFoundError if it is not UTF-8."""
    try:
        return request.data.split(b"\0", 1)[0].decode()
    except UnicodeDecodeError:
        raise FileNotFoundError(repr(request.data)) from None


def _line(entry: ListingEntry) -> bytes:
    """Encode one entry of a listing; mark a name that fits into no message as skipped ("S")."""
    text = f"D{entry.name}" if entry.size is None else f"F{entry.name}\t{entry.size}"
    line = text.encode() + b"\0"
    return line if len(line) <= MAX_DATA else b"S\0"


def _ack(request: Packet, data: bytes) -> Packet:
    """Return the answer to a request that succeeded."""
    return _answer(request, ACK, data)


def _nak(request: Packet, error: int) -> Packet:
    """Return the answer to a request that failed with a MAV_FTP_ERR."""
    return _answer(request, NAK, bytes((error,)))


def _answer(request: Packet, opcode: int, data: bytes) -> Packet:
    """Return the answer to a request."""
    return Packet(
        sequence=wire.next_sequence(request.sequence),
        session=request.session,
        opcode=opcode,
        size=len(data),
        requested=request.opcode,
        offset=request.offset,
        data=data,
    )


def _send_packet(client: Client, payload: bytes) -> None:
    """Send a FILE_TRANSFER_PROTOCOL to a client."""
    client.send(
        "FILE_TRANSFER_PROTOCOL",
        target_network=0,
        target_system=client.mavlink_id.system,
        target_component=client.mavlink_id.component,
        payload=payload,
    )
