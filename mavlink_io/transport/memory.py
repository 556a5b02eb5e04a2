"""Two ends of one name inside a process, for tests."""

import contextlib
import socket
from collections.abc import Sequence

from mavlink_io.transport.base import MAX_DATAGRAM, Handle, LinkLostError


class MemoryTransport:
    """One end of a pair inside a process; whole sends arrive as whole receives."""

    _waiting: dict[str, socket.socket] = {}  # noqa: RUF012 - the meeting place of the two ends is the point

    def __init__(self, address: str, name: str) -> None:
        self.address = address
        if name in self._waiting:
            self._socket = self._waiting.pop(name)
        else:
            self._socket, self._waiting[name] = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def handles(self) -> Sequence[Handle]:
        return (self._socket,)

    def send(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            self._socket.send(data)

    def receive(self) -> bytes:
        try:
            return self._socket.recv(MAX_DATAGRAM)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkLostError(f"{self.address}: {error}") from None

    def close(self) -> None:
        self._socket.close()
