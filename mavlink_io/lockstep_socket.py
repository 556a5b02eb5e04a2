"""A UDP socket with one peer, as compiled code reads and writes it.

In lockstep the calls of Python around each datagram take longer than the tick. A loop of compiled
code therefore calls the socket itself, and returns to Python when anything but the expected
datagram arrives. Every error is a datagram that has not arrived: Python then reads the socket, and
finds the same error.
"""

from __future__ import annotations

import socket
import sys
import time
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from mavlink_io import jit
from mavlink_io.jit import Native, numeric

if TYPE_CHECKING:  # the machine code does not depend on them
    from mavlink_io.endpoint import Endpoint
    from mavlink_io.transport import Peer

_FAMILY, _ADDRESS_LENGTH = socket.AF_INET, 16
"""Family and length of ``struct sockaddr_in``."""
_LENGTH = _ADDRESS_LENGTH
"""Index in ``UdpSocket.sender`` of the length that the system reads and writes."""
_DONT_WAIT: int = getattr(socket, "MSG_DONTWAIT", 0)
_MONOTONIC: int = getattr(time, "CLOCK_MONOTONIC", 1)

_recvfrom = jit.c_function("recvfrom", "liPPiPP")
_sendto = jit.c_function("sendto", "liPPiPI")
_clock_gettime = jit.c_function("clock_gettime", "iiP")
_sched_yield = jit.c_function("sched_yield", "i")


class UdpSocket(NamedTuple):
    """A socket and its only peer in memory of compiled code."""

    number: int
    """File descriptor."""
    connected: bool
    """Whether the system lets only datagrams of the peer pass."""
    address: Any
    """Address of the peer as the system writes it."""
    sender: Any
    """Address of the newest datagram, and its length."""
    clock: Any
    """Seconds and nanoseconds of the system's clock."""


class CompiledSocket(NamedTuple):
    """A socket for compiled code, and its memory for Python."""

    native: Native
    """Reference to a ``UdpSocket``."""
    memory: UdpSocket

    def return_rest(self, endpoint: Endpoint, memory: memoryview, received: int) -> None:
        """End a loop of ``receive``: let ``endpoint`` read the datagram that ended it.

        Parameters
        ----------
        endpoint : Endpoint
            Owner of the socket.
        memory : memoryview
            Memory of the datagram.
        received : int
            Newest result of ``receive``.
        """
        sender = self._sender() if received < 0 else None
        if endpoint.record_sender(sender) and received:
            endpoint.put_back(bytes(memory[: abs(received)]))

    def _sender(self) -> tuple[str, int]:
        """Return host and port that the newest datagram came from."""
        packed = bytes(self.memory.sender)
        return socket.inet_ntoa(packed[4:8]), int.from_bytes(packed[2:4], "big")


@lru_cache(maxsize=8)
def compiled_socket(peer: Peer) -> CompiledSocket:
    """Return the socket for compiled code.

    Parameters
    ----------
    peer : Peer
        The socket and its peer.

    Returns
    -------
    CompiledSocket
        The same for the same peer.
    """
    address = jit.octets(_ADDRESS_LENGTH)
    if peer.address is not None:
        host, port = peer.address
        family = bytes((_ADDRESS_LENGTH, _FAMILY))  # BSD and macOS
        if sys.platform == "linux":
            family = int(_FAMILY).to_bytes(2, sys.byteorder)
        packed = family + port.to_bytes(2, "big") + socket.inet_aton(host)
        memoryview(address)[: len(packed)] = packed
    memory = UdpSocket(
        number=peer.number,
        connected=peer.address is None,
        address=address,
        sender=jit.octets(_ADDRESS_LENGTH + 4),
        clock=jit.view(jit.octets(16), "q"),
    )
    return CompiledSocket(jit.native(memory), memory)


@numeric
def clock_s(link: UdpSocket) -> float:
    """Return the time of a clock that never steps, from an arbitrary origin.

    Parameters
    ----------
    link : UdpSocket
        Its memory is used.

    Returns
    -------
    float
        Wall time, s.
    """
    _clock_gettime(_MONOTONIC, link.clock.ctypes.data)
    return float(link.clock[0] + 1e-9 * link.clock[1])


@numeric
def receive(link: UdpSocket, memory: Any, spin_s: float) -> int:
    """Wait for a datagram.

    Parameters
    ----------
    link : UdpSocket
        The socket.
    memory : array of octets
        Receives the datagram.
    spin_s : float
        Wall time for which to poll; 0 blocks instead, for as long as the socket is set to.

    Returns
    -------
    int
        Number of octets; 0 if none has arrived, negative if they came from another address than
        the peer's.
    """
    received = _receive_once(link, memory, 0 if spin_s == 0.0 else _DONT_WAIT)
    if received < 0 and spin_s > 0.0:
        until_s = clock_s(link) + spin_s
        while received < 0 and clock_s(link) < until_s:
            _sched_yield()
            received = _receive_once(link, memory, _DONT_WAIT)
    if received <= 0:
        return 0
    return received if link.connected or _is_from_peer(link) else -received


@numeric
def _receive_once(link: UdpSocket, memory: Any, flags: int) -> int:
    """Return the number of octets of a datagram; negative if none has arrived."""
    data, size = memory.ctypes.data, len(memory)
    if link.connected:
        return int(_recvfrom(link.number, data, size, flags, 0, 0))
    link.sender[_LENGTH] = _ADDRESS_LENGTH
    sender = link.sender.ctypes.data
    return int(_recvfrom(link.number, data, size, flags, sender, sender + _LENGTH))


@numeric
def _is_from_peer(link: UdpSocket) -> bool:
    """Return whether port and host of the newest datagram are those of the peer."""
    same = True
    for i in range(2, 8):
        same = same and link.sender[i] == link.address[i]
    return same


@numeric
def send(link: UdpSocket, memory: Any, length: int) -> None:
    """Send a datagram; it is lost if the system does not take it at once.

    The first attempt may report that an earlier datagram was refused: there is a second one.

    Parameters
    ----------
    link : UdpSocket
        The socket.
    memory : array of octets
        Begins with the datagram.
    length : int
        Number of octets.
    """
    if _send_once(link, memory, length) < 0:
        _send_once(link, memory, length)


@numeric
def _send_once(link: UdpSocket, memory: Any, length: int) -> int:
    """Return the number of octets sent; negative after an error."""
    data = memory.ctypes.data
    if link.connected:
        return int(_sendto(link.number, data, length, _DONT_WAIT, 0, 0))
    address = link.address.ctypes.data
    return int(_sendto(link.number, data, length, _DONT_WAIT, address, _ADDRESS_LENGTH))
