"""TCP transports: a connection to a server, and a server of many clients.

TCP is lossless: a full pipe blocks the sender.
"""

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
"""Default wall time for which a full pipe may block the sender, in seconds."""
MAX_CLIENTS = 32
"""Maximum number of connections of a server."""
CLIENT_IDLE_S = 5.0
"""Wall time without received bytes after which a client gives way to a new one, in seconds.

A ground station sends a heartbeat every second."""
ACCEPTS_PER_RECEIVE = 64
"""Maximum number of connections accepted per ``receive``, so that a flood does not stop reading."""
ACCEPT_PAUSE_S = 1.0
"""Wall time without accepting after the system ran out of files or memory, in seconds."""
READ_BYTES = 16_384
"""Maximum number of bytes read per ``receive`` from all clients of a server together."""

SEND_BUFFER_BYTES = 1 << 18
"""Size of the system's send buffer of each client of a server, in bytes.

The system would let it grow to several megabytes. A recorder that is slower than a simulation at
full speed would then be minutes of vehicle time behind it. In real time the telemetry of half a
minute fits.
"""

_RESOURCE_ERRORS = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class TcpClient:
    """A connection to a TCP server.

    Parameters
    ----------
    address : str
        Address of the transport, for error messages.
    host, port : str, int
        The server.
    send_timeout_s : float
        Wall time for which a full pipe may block the sender, in seconds. ``send`` then raises
        LinkLostError.

    Raises
    ------
    AddressError
        No connection could be made.
    """

    def __init__(
        self, address: str, host: str, port: int, *, send_timeout_s: float = SEND_TIMEOUT_S
    ) -> None:
        self.address = address
        self._send_timeout_s = send_timeout_s
        self._socket = open_or_raise(
            address, lambda: socket.create_connection((host, port), timeout=SEND_TIMEOUT_S)
        )
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def handles(self) -> Sequence[Handle]:
        """Return the socket."""
        return (self._socket,)

    def send(self, data: bytes) -> None:
        """Send whole frames. Raises LinkLostError."""
        try:
            _send(self._socket, data, self._send_timeout_s)
        except OSError as error:
            raise LinkLostError(f"{self.address}: {error}") from None

    def receive(self) -> bytes:
        """Return the bytes that have arrived, b"" if none. Raises LinkLostError."""
        data = _receive(self._socket)
        if data is None:
            raise LinkLostError(f"{self.address}: closed by the other end")
        return data

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class TcpServer:
    """A TCP server that sends to every connected client and receives from all of them.

    It does not forward the bytes of one client to the others.

    Parameters
    ----------
    address : str
        Address of the transport, for error messages.
    host, port : str, int
        Local address; port 0 lets the system choose.
    send_timeout_s : float
        Wall time for which clients with a full pipe together block the sender (lossless), in
        seconds. After it they are disconnected, so that they cannot stop the vehicle.

    Raises
    ------
    AddressError
        The port cannot be bound.

    Notes
    -----
    At most ``MAX_CLIENTS`` are connected at a time. A further one replaces the client that has been
    silent for longest, if for more than ``CLIENT_IDLE_S``; otherwise it is closed at once.
    """

    def __init__(
        self, address: str, host: str, port: int, *, send_timeout_s: float = SEND_TIMEOUT_S
    ) -> None:
        self.address = address
        self._send_timeout_s = send_timeout_s
        self._clients: list[socket.socket] = []
        self._received_s: dict[socket.socket, float] = {}
        """Wall time at which each client connected or sent last."""
        self._disconnected: list[socket.socket] = []
        self._accept_after_s = 0.0
        self._listener = open_or_raise(address, lambda: socket.create_server((host, port)))
        self._listener.setblocking(False)

    @property
    def port(self) -> int:
        """The bound port, also where the system chose it (port 0)."""
        return int(self._listener.getsockname()[1])

    @property
    def newest(self) -> Handle | None:
        """The connection of the client that connected last; None without a client."""
        return self._clients[-1] if self._clients else None

    def handles(self) -> Sequence[Handle]:
        """Return the clients' sockets, and the listening socket while new clients are accepted."""
        if wall_s() < self._accept_after_s:
            return tuple(self._clients)
        return (self._listener, *self._clients)

    def send(self, data: bytes) -> None:
        """Send whole frames to every client; disconnect a client that cannot receive them.

        Parameters
        ----------
        data : bytes
            One or more complete frames.
        """
        until_s = wall_s() + self._send_timeout_s
        for client in list(self._clients):
            try:
                _send(client, data, max(0.0, until_s - wall_s()))
            except OSError:
                self._drop(client)

    def receive(self) -> bytes:
        """Return the bytes that have arrived from all clients, b"" if none."""
        return b"".join(data for _, data in self.receive_from())

    def receive_from(self) -> Sequence[Piece]:
        """Return the bytes of each client; b"" for one that disconnected since the last call."""
        if wall_s() >= self._accept_after_s:
            self._accept()
        received: list[Piece] = []
        for client in list(self._clients):
            data = _receive(client, READ_BYTES // len(self._clients))
            if data is None:
                self._drop(client)
            elif data:
                self._received_s[client] = wall_s()
                received.append((client, data))
        received += ((client, b"") for client in self._disconnected)
        self._disconnected.clear()
        return received

    def close(self) -> None:
        """Disconnect all clients and close the listening socket."""
        for client in list(self._clients):
            self._drop(client)
        self._listener.close()

    def _accept(self) -> None:
        """Accept waiting connections up to ``MAX_CLIENTS`` clients in use; close the others."""
        for _ in range(ACCEPTS_PER_RECEIVE):
            try:
                client, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in _RESOURCE_ERRORS:
                    self._accept_after_s = wall_s() + ACCEPT_PAUSE_S
                    return
                continue  # this connection broke before it was accepted
            if len(self._clients) >= MAX_CLIENTS and not self._drop_idle():
                client.close()
                continue
            try:
                client.setblocking(False)
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
            except OSError:
                client.close()
                continue
            self._clients.append(client)
            self._received_s[client] = wall_s()

    def _drop_idle(self) -> bool:
        """Disconnect the client that has been silent for longest, if it is idle."""
        client = min(self._clients, key=self._received_s.__getitem__)
        idle = wall_s() - self._received_s[client] > CLIENT_IDLE_S
        if idle:
            self._drop(client)
        return idle

    def _drop(self, client: socket.socket) -> None:
        """Disconnect a client."""
        self._clients.remove(client)
        del self._received_s[client]
        self._disconnected.append(client)
        client.close()


def _send(connection: socket.socket, data: bytes, send_timeout_s: float) -> None:
    """Send all bytes on a stream. Raises OSError if the pipe stays full for ``send_timeout_s``."""
    remaining = memoryview(data)
    while remaining:
        try:
            remaining = remaining[connection.send(remaining) :]
        except BlockingIOError:
            if not writable(connection, send_timeout_s):
                raise TimeoutError(f"nothing was read for {send_timeout_s:g} s") from None


def _receive(connection: socket.socket, max_bytes: int = MAX_DATAGRAM) -> bytes | None:
    """Return the bytes that have arrived on a stream; b"" if none, None if it was closed."""
    try:
        return connection.recv(max_bytes) or None
    except BlockingIOError:
        return b""
    except OSError:
        return None
