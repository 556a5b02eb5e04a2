"""Transport between two ends inside one process, for tests."""

import contextlib
import socket
from collections.abc import Sequence

from mavlink_io.transport.base import MAX_DATAGRAM, Handle, LinkLostError


class MemoryTransport:
    """One end of a pair inside a process; the bytes of one send arrive in one receive.

    The first transport of a name waits for the second one.
    """

    _waiting: dict[str, socket.socket] = {}  # noqa: RUF012 - shared on purpose: both ends meet here
    """Other end of each name that one transport has opened so far."""

    def __init__(self, address: str, name: str) -> None:
        self.address = address
        if name in self._waiting:
            self._socket = self._waiting.pop(name)
        else:
            self._socket, self._waiting[name] = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def handles(self) -> Sequence[Handle]:
        """Return the socket."""
        return (self._socket,)

    def send(self, data: bytes) -> None:
        """Send whole frames; drop them if the other end has too many unread ones."""
        with contextlib.suppress(BlockingIOError):
            self._socket.send(data)

    def receive(self) -> bytes:
        """Return the bytes of one send, b"" if none have arrived. Raises LinkLostError."""
        try:
            return self._socket.recv(MAX_DATAGRAM)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkLostError(f"{self.address}: {error}") from None

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
