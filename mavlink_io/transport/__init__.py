"""Byte transports behind one address syntax: UDP, TCP, serial line, memory.

=====================  ======================================================================
``udpin:HOST:PORT``    bind a port, learn peers from their datagrams, send to all of them
``udpout:HOST:PORT``   send to one peer, and receive from no other
``tcp:HOST:PORT``      connect to a server; lossless, a full pipe blocks the sender
``tcpin:HOST:PORT``    serve many clients
``serial:DEVICE:BAUD`` use a serial line; reopen it after it was unplugged
``memory:NAME``        connect two ends of one name inside a process, for tests
=====================  ======================================================================
"""

from typing import NamedTuple

from mavlink_io.transport.base import (
    MAX_DATAGRAM,
    SPIN_S,
    AddressError,
    Handle,
    LinkLostError,
    LockstepTransport,
    Peer,
    Piece,
    SharedTransport,
    Transport,
    spin_s,
    wait,
)
from mavlink_io.transport.memory import MemoryTransport
from mavlink_io.transport.serial_line import SerialTransport
from mavlink_io.transport.tcp import SEND_TIMEOUT_S, TcpClient, TcpServer
from mavlink_io.transport.udp import UdpClient, UdpTransport

__all__ = (
    "MAX_DATAGRAM",
    "SEND_TIMEOUT_S",
    "SPIN_S",
    "AddressError",
    "Handle",
    "LinkLostError",
    "LockstepTransport",
    "MemoryTransport",
    "Peer",
    "Piece",
    "SerialTransport",
    "SharedTransport",
    "TcpClient",
    "TcpServer",
    "Transport",
    "UdpClient",
    "UdpTransport",
    "baud_rate",
    "open_transport",
    "spin_s",
    "wait",
)

_KINDS = ("udpin", "udpout", "tcp", "tcpin", "serial", "memory")
_MAX_PORT, _MAX_BAUD = 65_535, (1 << 31) - 1


class _AddressParts(NamedTuple):
    """The parts of an address."""

    kind: str
    """Kind of the address: one of ``_KINDS``."""
    name: str
    """Host, serial device or name in memory."""
    number: int
    """Port or baud rate; 0 for memory."""


def open_transport(
    address: str, *, wait_for_device: bool = False, send_timeout_s: float = SEND_TIMEOUT_S
) -> Transport:
    """Open the transport of an address.

    Parameters
    ----------
    address : str
        Address in the syntax of the table above.
    wait_for_device : bool
        Whether to wait for a serial device that does not exist yet (as the vehicle waits for its
        radio), instead of raising AddressError.
    send_timeout_s : float
        Wall time for which a full TCP pipe may block the sender, in seconds.

    Returns
    -------
    Transport
        The open transport.

    Raises
    ------
    AddressError
        The address is malformed, or its port or device cannot be opened.
    """
    kind, name, number = _split_address(address)
    match kind:
        case "memory":
            return MemoryTransport(address, name)
        case "udpin":
            return UdpTransport(address, name, number)
        case "udpout":
            return UdpClient(address, name, number)
        case "tcp":
            return TcpClient(address, name, number, send_timeout_s=send_timeout_s)
        case "tcpin":
            return TcpServer(address, name, number, send_timeout_s=send_timeout_s)
        case _:
            return SerialTransport(address, name, number, wait_for_device=wait_for_device)


def baud_rate(address: str) -> int | None:
    """Return the baud rate of an address.

    Parameters
    ----------
    address : str
        Any text.

    Returns
    -------
    int or None
        Baud rate in bit/s; None if the text is not the address of a serial line.
    """
    try:
        kind, _, number = _split_address(address)
    except AddressError:
        return None
    return number if kind == "serial" else None


def _split_address(address: str) -> _AddressParts:
    """Return the parts of an address. Raises AddressError if it is malformed."""
    kind, _, rest = address.partition(":")
    if kind == "memory" and rest:
        return _AddressParts(kind, rest, 0)
    name, colon, number = rest.rpartition(":")
    if kind not in _KINDS or not colon or not name:
        raise AddressError(
            f"address {address!r}: expected udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT,"
            " tcpin:HOST:PORT, serial:DEVICE:BAUD or memory:NAME"
        )
    minimum, maximum, quantity = (
        (1, _MAX_BAUD, "baud rate") if kind == "serial" else (0, _MAX_PORT, "port number")
    )
    if not number.isdecimal() or not minimum <= int(number) <= maximum:
        raise AddressError(f"address {address!r}: {number!r} is no {quantity}")
    if kind != "serial" and not _is_resolvable_text(name):
        raise AddressError(f"address {address!r}: {name!r} is no host name")
    return _AddressParts(kind, name, int(number))


def _is_resolvable_text(name: str) -> bool:
    """Return whether a resolver accepts the text as a host name (IDNA encoding)."""
    try:
        name.encode("idna")
    except UnicodeError:
        return False
    return True
