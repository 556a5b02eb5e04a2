"""TCP: a connection to a server, and a server of many clients. Loses nothing and pushes back."""

import contextlib
import select
import socket
from collections.abc import Sequence

from mavlink_io.transport.base import MAX_DATAGRAM, Handle, LinkLostError, open_or_raise

SEND_TIMEOUT_S = 10.0
"""How long a full pipe may hold its sender up, where nobody says otherwise."""


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
    stop the vehicle."""

    def __init__(
        self, address: str, host: str, port: int, *, patience_s: float = SEND_TIMEOUT_S
    ) -> None:
        self.address = address
        self._patience_s = patience_s
        self._clients: list[socket.socket] = []
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
        return (self._listener, *self._clients)

    def send(self, data: bytes) -> None:
        for client in list(self._clients):
            try:
                _send(client, data, self._patience_s)
            except OSError:
                self._drop(client)

    def receive(self) -> bytes:
        with contextlib.suppress(BlockingIOError):
            client, _ = self._listener.accept()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients.append(client)
        received = []
        for client in list(self._clients):
            data = _receive(client)
            if data is None:
                self._drop(client)
            elif data:
                received.append(data)
        return b"".join(received)

    def close(self) -> None:
        for client in list(self._clients):
            self._drop(client)
        self._listener.close()

    def _drop(self, client: socket.socket) -> None:
        self._clients.remove(client)
        client.close()


def _send(connection: socket.socket, data: bytes, patience_s: float) -> None:
    """Send all of it on a stream, waiting ``patience_s`` for room in a full pipe. Raises OSError
    when it stays full."""
    rest = memoryview(data)
    while rest:
        try:
            rest = rest[connection.send(rest) :]
        except BlockingIOError:
            if not select.select((), (connection,), (), patience_s)[1]:
                raise TimeoutError(f"nothing was read for {patience_s:g} s") from None


def _receive(connection: socket.socket) -> bytes | None:
    """What has arrived on a stream without waiting: b"" for nothing, None when the other end closed
    it."""
    try:
        return connection.recv(MAX_DATAGRAM) or None
    except BlockingIOError:
        return b""
    except OSError:
        return None
