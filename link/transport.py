"""Byte transports behind one address syntax: UDP, TCP, serial line, memory.

=====================  ======================================================================
``udpin:HOST:PORT``    bind, learn peers from their first datagram, answer every one of them
``udpout:HOST:PORT``   send to a peer
``tcp:HOST:PORT``      connect to a server; loses nothing and pushes back
``tcpin:HOST:PORT``    serve many clients
``serial:DEVICE:BAUD`` a serial line
``memory:NAME``        two ends of one name inside a process, for tests
=====================  ======================================================================
"""

import contextlib
import os
import select
import socket
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import serial

from link.clock import wall_s

Handle = Any
"""What ``select`` waits for: a socket or an open serial port."""

EAGER_S = 5e-3
"""How long an eager wait looks before it sleeps: many ticks of the other end, so that a third process in between does
not put the two to sleep. Measured on two cores, a round trip of two sleeping processes takes 80 us, of two eager 9."""
PEER_IDLE_S = 10.0
"""A UDP peer that was silent for longer is forgotten."""
MAX_DATAGRAM = 65_535


_give_way: Callable[[], None] = getattr(os, "sched_yield", lambda: time.sleep(0.0))


class AddressError(ValueError):
    """An address that names no transport; the message says what is wrong and what would be right."""


class LinkLostError(ConnectionError):
    """The other end is gone for good."""


class Transport(Protocol):
    """One verb each way. ``receive`` never blocks: ``wait`` does, for several transports at once."""

    address: str

    def handles(self) -> Sequence[Handle]: ...

    def send(self, data: bytes) -> None: ...

    def receive(self) -> bytes:
        """What has arrived, b"" for nothing. Raises LinkLostError when the other end is gone for good."""
        ...

    def close(self) -> None: ...


def wait(transports: Sequence[Transport], timeout_s: float, *, eager: bool = False) -> list[Transport]:
    """Those of the transports that have something to receive, as soon as one has or the timeout is over.

    An ``eager`` wait looks again and again for its first ``EAGER_S`` before it sleeps, giving way to whoever else wants
    the processor: two ends in lockstep answer within that time, and are spared waking each other.
    """
    handles = {handle: transport for transport in transports for handle in transport.handles()}
    if not handles:
        time.sleep(max(0.0, timeout_s))
        return []
    ready = select.select(handles, (), (), 0.0)[0]
    if not ready and eager:
        until_s = wall_s() + min(EAGER_S, timeout_s)
        while not ready and wall_s() < until_s:
            _give_way()
            ready = select.select(handles, (), (), 0.0)[0]
    if not ready and timeout_s > 0.0:
        ready = select.select(handles, (), (), timeout_s)[0]
    return list(dict.fromkeys(handles[handle] for handle in ready))


class UdpTransport:
    """A UDP socket: bound (``udpin``, learns its peers) or aimed at one peer (``udpout``)."""

    def __init__(self, address: str, host: str, port: int, *, bind: bool) -> None:
        self.address = address
        self._peers: dict[tuple[str, int], float] = {}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        with contextlib.suppress(OSError):
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        if bind:
            _open(address, lambda: self._socket.bind((host, port)))
        else:
            _open(address, lambda: self._peers.update({(socket.gethostbyname(host), port): float("inf")}))

    def handles(self) -> Sequence[Handle]:
        return (self._socket,)

    def send(self, data: bytes) -> None:
        for peer in list(self._peers):
            with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
                self._socket.sendto(data, peer)

    def receive(self) -> bytes:
        try:
            data, peer = self._socket.recvfrom(MAX_DATAGRAM)
        except (BlockingIOError, ConnectionRefusedError, ConnectionResetError):
            return b""
        self._remember(peer)
        return data

    def close(self) -> None:
        self._socket.close()

    def _remember(self, peer: tuple[str, int]) -> None:
        if self._peers.get(peer) == float("inf"):
            return
        now = wall_s()
        if peer not in self._peers:
            for idle in [p for p, seen in self._peers.items() if now - seen > PEER_IDLE_S]:
                del self._peers[idle]
        self._peers[peer] = now


class TcpClient:
    """A connection to a TCP server. A full pipe blocks the sender for at most ``patience_s``."""

    def __init__(self, address: str, host: str, port: int, *, patience_s: float = 10.0) -> None:
        self.address = address
        self._patience_s = patience_s
        self._socket = _open(address, lambda: socket.create_connection((host, port), timeout=patience_s))
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
    """Serves every client that connects. What one sends, all others may read only through the endpoint above.

    With ``patience_s`` above zero a full pipe holds the sender back (lossless); a client that stays stuck for
    longer, and with zero one whose pipe is full at all, is dropped, so that it can never stop the vehicle.
    """

    def __init__(self, address: str, host: str, port: int, *, patience_s: float = 10.0) -> None:
        self.address = address
        self._patience_s = patience_s
        self._clients: list[socket.socket] = []
        self._listener = _open(address, lambda: socket.create_server((host, port)))
        self._listener.setblocking(False)

    @property
    def port(self) -> int:
        """The bound port: tells which one the system chose for port 0."""
        return int(self._listener.getsockname()[1])

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


class SerialTransport:
    """A serial line, opened for this process alone, with a bounded write so that a stuck line cannot stop a tick."""

    def __init__(self, address: str, device: str, baud: int) -> None:
        self.address = address
        self._port = _open(address, lambda: serial.Serial(device, baud, timeout=0, write_timeout=1.0, exclusive=True))

    def handles(self) -> Sequence[Handle]:
        return (self._port,)

    def send(self, data: bytes) -> None:
        try:
            self._port.write(data)
        except serial.SerialTimeoutException:
            return
        except (serial.SerialException, OSError) as error:
            raise LinkLostError(f"{self.address}: {error}") from None

    def receive(self) -> bytes:
        try:
            return bytes(self._port.read(4096))
        except (serial.SerialException, OSError) as error:
            raise LinkLostError(f"{self.address}: {error}") from None

    def close(self) -> None:
        self._port.close()


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


def open_transport(address: str) -> Transport:
    """Open the transport that an address names.

    Raises:
        AddressError: the address is malformed, or its port or device cannot be opened.
    """
    kind, _, rest = address.partition(":")
    if kind == "memory" and rest:
        return MemoryTransport(address, rest)
    where, colon, number = rest.rpartition(":")
    if kind not in ("udpin", "udpout", "tcp", "tcpin", "serial") or not colon or not where:
        raise AddressError(
            f"address {address!r}: expected udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT, "
            "serial:DEVICE:BAUD or memory:NAME"
        )
    if not number.isdecimal() or (kind != "serial" and int(number) > 65_535):
        raise AddressError(
            f"address {address!r}: {number!r} is no {'baud rate' if kind == 'serial' else 'port number'}"
        )
    match kind:
        case "udpin" | "udpout":
            return UdpTransport(address, where, int(number), bind=kind == "udpin")
        case "tcp":
            return TcpClient(address, where, int(number))
        case "tcpin":
            return TcpServer(address, where, int(number))
        case _:
            return SerialTransport(address, where, int(number))


def _open(address: str, opener: Any) -> Any:
    try:
        return opener()
    except (OSError, serial.SerialException) as error:
        raise AddressError(f"address {address!r}: {error}") from None


def _send(connection: socket.socket, data: bytes, patience_s: float) -> None:
    """Send all of it on a stream, waiting ``patience_s`` for room in a full pipe. Raises OSError when it stays full."""
    rest = memoryview(data)
    while rest:
        try:
            rest = rest[connection.send(rest) :]
        except BlockingIOError:
            if not select.select((), (connection,), (), patience_s)[1]:
                raise TimeoutError(f"nothing was read for {patience_s:g} s") from None


def _receive(connection: socket.socket) -> bytes | None:
    """What has arrived on a stream without waiting: b"" for nothing, None when the other end closed it."""
    try:
        return connection.recv(MAX_DATAGRAM) or None
    except BlockingIOError:
        return b""
    except OSError:
        return None
