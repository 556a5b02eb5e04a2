"""TCP: a connection to a server, and a server of many clients. Loses nothing and pushes back."""

import errno
import socket
from collections.abc import Sequence

from mavlink_io.clock import wall_s
from mavlink_io.transport.base import (
    MAX_DATAGRAM,
    Handle,
    LinkLostError,
    Piece,
    open_or_raise,
    writable,
)

SEND_TIMEOUT_S = 10.0
"""How long a full pipe may hold its sender up, where nobody says otherwise."""
MAX_CLIENTS = 32
"""Connections that a server keeps at a time. A further one is closed as soon as it is accepted."""
ACCEPTS_PER_RECEIVE = 64
"""Connections accepted in one call of ``receive``: a flood drains, and reading goes on."""
ACCEPT_PAUSE_S = 1.0
"""Wall seconds without accepting after the system had no file or memory left for a connection."""
READ_BYTES = 16_384
"""Bytes that a server reads in one call of ``receive`` from all clients together; the rest waits in
the operating system."""


_NO_ROOM = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class TcpClient:
    """A connection to a TCP server. A full pipe blocks the sender for at most ``patience_s``."""

    def __init__(
        self, address: str, host: str, port: int, *, patience_s: float = SEND_TIMEOUT_S
    ) -> None:
        self.address = address
        self._patience_s = patience_s
        self._socket = open_or_raise(
            address, lambda: socket.create_connection((host, port), timeout=SEND_TIMEOUT_S)
        )
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def handles(self) -> Sequence[Handle]:
        return (self._socket,)

    def send(self, data: bytes) -> None:
        try:
            _send(self._socket, data, self._patience_s)
        except OSError as error:
            raise LinkLostError(f"{self.address}: {error}") from None

    def receive(self) -> bytes:
        data = _receive(self._socket)
        if data is None:
            raise LinkLostError(f"{self.address}: closed by the other end")
        return data

    def close(self) -> None:
        self._socket.close()


class TcpServer:
    """Serves every client that connects. What one sends, all others may read only through the
    endpoint above.

    With ``patience_s`` above zero a full pipe holds the sender back (lossless); a client that stays
    stuck for longer, and with zero one whose pipe is full at all, is dropped, so that it can never
    stop the vehicle. At most ``MAX_CLIENTS`` are connected at a time."""

    def __init__(
        self, address: str, host: str, port: int, *, patience_s: float = SEND_TIMEOUT_S
    ) -> None:
        self.address = address
        self._patience_s = patience_s
        self._clients: list[socket.socket] = []
        self._left: list[socket.socket] = []
        self._accepts_from_s = 0.0
        self._listener = open_or_raise(address, lambda: socket.create_server((host, port)))
        self._listener.setblocking(False)

    @property
    def port(self) -> int:
        """The bound port: tells which one the system chose for port 0."""
        return int(self._listener.getsockname()[1])

    @property
    def newest(self) -> Handle | None:
        """The connection of the client that came last, None while there is no client."""
        return self._clients[-1] if self._clients else None

    def handles(self) -> Sequence[Handle]:
        if wall_s() < self._accepts_from_s:
            return tuple(self._clients)
        return (self._listener, *self._clients)

    def send(self, data: bytes) -> None:
        for client in list(self._clients):
            try:
                _send(client, data, self._patience_s)
            except OSError:
                self._drop(client)

    def receive(self) -> bytes:
        return b"".join(data for _, data in self.receive_from())

    def receive_from(self) -> Sequence[Piece]:
        if wall_s() >= self._accepts_from_s:
            self._accept()
        received: list[Piece] = []
        for client in list(self._clients):
            data = _receive(client, READ_BYTES // len(self._clients))
            if data is None:
                self._drop(client)
            elif data:
                received.append((client, data))
        received += ((client, b"") for client in self._left)
        self._left.clear()
        return received

    def close(self) -> None:
        for client in list(self._clients):
            self._drop(client)
        self._listener.close()

    def _accept(self) -> None:
        """Take in those who wait to be connected, up to ``MAX_CLIENTS``; close the rest of them."""
        for _ in range(ACCEPTS_PER_RECEIVE):
            try:
                client, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in _NO_ROOM:
                    self._accepts_from_s = wall_s() + ACCEPT_PAUSE_S
                    return
                continue  # this one connection broke before it was accepted
            if len(self._clients) >= MAX_CLIENTS:
                client.close()
                continue
            try:
                client.setblocking(False)
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            except OSError:
                client.close()
                continue
            self._clients.append(client)

    def _drop(self, client: socket.socket) -> None:
        self._clients.remove(client)
        self._left.append(client)
        client.close()


def _send(connection: socket.socket, data: bytes, patience_s: float) -> None:
    """Send all of it on a stream, waiting ``patience_s`` for room in a full pipe. Raises OSError
    when it stays full."""
    rest = memoryview(data)
    while rest:
        try:
            rest = rest[connection.send(rest) :]
        except BlockingIOError:
            if not writable(connection, patience_s):
                raise TimeoutError(f"nothing was read for {patience_s:g} s") from None


def _receive(connection: socket.socket, most_bytes: int = MAX_DATAGRAM) -> bytes | None:
    """What has arrived on a stream without waiting: b"" for nothing, None when the other end closed
    it."""
    try:
        return connection.recv(most_bytes) or None
    except BlockingIOError:
        return b""
    except OSError:
        return None
