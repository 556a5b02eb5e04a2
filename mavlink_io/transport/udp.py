"""UDP transports: datagrams to one peer, or to every peer that has sent recently."""

import contextlib
import errno
import math
import socket
from collections.abc import Sequence

from mavlink_io.clock import wall_s
from mavlink_io.transport.base import (
    MAX_DATAGRAM,
    Handle,
    Peer,
    Piece,
    open_or_raise,
    read_eagerly,
    set_receive_timeout,
)

PEER_IDLE_S = 10.0
"""Wall time without a datagram after which a peer may be removed, in seconds.

It is removed when a new one comes, or when a simulator in lockstep is to be the only one."""
MAX_PEERS = 32
"""Maximum number of peers of one ``udpin``.

At the maximum, datagrams of further peers are ignored: a flood of source ports neither fills the
memory nor displaces a known peer."""
RECONNECT_S = 1.0
"""Wall time between two attempts to connect without a route, in seconds."""

_NO_ROUTE = frozenset(
    (
        errno.ENETUNREACH,
        errno.EHOSTUNREACH,
        errno.ENETDOWN,
        errno.EADDRNOTAVAIL,
        errno.EINVAL,
    )
)
"""Errors without a route to the peer, or (EINVAL) without the socket's local address."""

Address = tuple[str, int]
_DONT_WAIT = socket.MSG_DONTWAIT


class UdpTransport:
    """A bound UDP socket (``udpin``) that sends to every peer that has sent to it.

    Parameters
    ----------
    address : str
        Address of the transport, for error messages.
    host, port : str, int
        Local address.

    Raises
    ------
    AddressError
        The port cannot be bound.

    Notes
    -----
    A datagram that cannot be sent, for example because the network is down, is lost silently.
    """

    def __init__(self, address: str, host: str, port: int) -> None:
        self.address, self.eager = address, False
        self._peers: dict[Address, float] = {}
        self._socket = _udp_socket()
        open_or_raise(address, lambda: self._socket.bind((host, port)))

    def handles(self) -> Sequence[Handle]:
        """Return the socket."""
        return (self._socket,)

    def send(self, data: bytes) -> None:
        """Send whole frames to every peer, as one datagram each."""
        for peer in self._peers:
            try:
                self._socket.sendto(data, _DONT_WAIT, peer)
            except OSError:
                continue

    def receive(self) -> bytes:
        """Return the bytes of one datagram, b"" if none has arrived."""
        return b"".join(data for _, data in self.receive_from())

    def receive_from(self) -> Sequence[Piece]:
        """Return one datagram with its peer; nothing if there are too many peers for a new one."""
        read = self._socket.recvfrom
        try:
            data, peer = read_eagerly(read) if self.eager else read(MAX_DATAGRAM, _DONT_WAIT)
        except OSError:
            return ()
        return ((peer, data),) if self._remember(peer) else ()

    def peer(self) -> Peer | None:
        """Return the socket with its peer; None unless exactly one has sent recently."""
        if len(self._peers) > 1:
            self._forget_idle(wall_s())
        if len(self._peers) != 1:
            return None
        (address,) = self._peers
        return Peer(self._socket.fileno(), address)

    def record_sender(self, sender: Address | None) -> bool:
        """Record the sender of a datagram, None for the peer; return False for one too many."""
        return self._remember(sender or next(iter(self._peers)))

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _remember(self, peer: Address) -> bool:
        """Store when a peer has sent; return False if there are too many peers for a new one."""
        now = wall_s()
        if peer not in self._peers:
            self._forget_idle(now)
            if len(self._peers) >= MAX_PEERS:
                return False
        self._peers[peer] = now
        return True

    def _forget_idle(self, now_s: float) -> None:
        """Remove the peers that have sent nothing for `PEER_IDLE_S`."""
        for idle in [p for p, last in self._peers.items() if now_s - last > PEER_IDLE_S]:
            del self._peers[idle]


class UdpClient:
    """A UDP socket connected to one peer (``udpout``); the kernel drops datagrams of others.

    Parameters
    ----------
    address : str
        Address of the transport, for error messages.
    host, port : str, int
        The peer.

    Raises
    ------
    AddressError
        The host cannot be resolved.

    Notes
    -----
    The peer may start later or restart on the same port; datagrams in the meantime are lost.
    Without a route to the peer the socket is connected again every ``RECONNECT_S``.
    """

    def __init__(self, address: str, host: str, port: int) -> None:
        self.address, self.eager = address, False
        self._peer: Address = open_or_raise(address, lambda: (socket.gethostbyname(host), port))
        self._socket: socket.socket | None = None
        self._retry_s = 0.0
        open_or_raise(address, self._connect)

    def handles(self) -> Sequence[Handle]:
        """Return the connected socket; nothing without a route to the peer."""
        connected = self._connected()
        return () if connected is None else (connected,)

    def send(self, data: bytes) -> None:
        """Send whole frames as one datagram; drop them without a route to the peer."""
        connected = self._connected()
        if connected is None:
            return
        try:
            try:
                connected.send(data, _DONT_WAIT)
            except ConnectionRefusedError:  # caused by an earlier datagram: send this one again
                connected.send(data, _DONT_WAIT)
        except OSError as error:
            if error.errno in _NO_ROUTE:
                self._disconnect()

    def receive(self) -> bytes:
        """Return the bytes of one datagram, b"" if none has arrived."""
        if self._socket is None:
            return b""
        read = self._socket.recv
        try:
            try:
                return read_eagerly(read) if self.eager else read(MAX_DATAGRAM, _DONT_WAIT)
            except ConnectionRefusedError:  # caused by a sent datagram: received ones still wait
                return read(MAX_DATAGRAM, _DONT_WAIT)
        except OSError:
            return b""

    def peer(self) -> Peer | None:
        """Return the connected socket; None without a route to the peer."""
        return None if self._socket is None else Peer(self._socket.fileno(), None)

    def record_sender(self, sender: Address | None) -> bool:
        """Return True: a connected socket has one peer."""
        return True

    def close(self) -> None:
        """Close the socket for good."""
        self._disconnect()
        self._retry_s = math.inf

    def _connected(self) -> socket.socket | None:
        """Return the connected socket; connect it if that is due."""
        if self._socket is None and wall_s() >= self._retry_s:
            with contextlib.suppress(OSError):
                self._connect()
        return self._socket

    def _connect(self) -> None:
        """Connect a new socket, because an old one keeps its local address, which may be gone.

        Raises OSError if the peer's address cannot be used; a missing route is no error.
        """
        self._retry_s = wall_s() + RECONNECT_S
        connecting = _udp_socket()
        try:
            connecting.connect(self._peer)
        except OSError as error:
            connecting.close()
            if error.errno not in _NO_ROUTE:
                raise
            return
        self._socket = connecting

    def _disconnect(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def _udp_socket() -> socket.socket:
    """Return a UDP socket with a receive buffer of 1 MiB where possible.

    Its reads and sends do not block, except those of ``read_eagerly``.
    """
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    set_receive_timeout(udp)
    with contextlib.suppress(OSError):
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    return udp
