"""Byte transports behind one address syntax: UDP, TCP, serial line, memory.

=====================  ======================================================================
``udpin:HOST:PORT``    bind, learn peers from their first datagram, answer every one of them
``udpout:HOST:PORT``   send to a peer
``tcp:HOST:PORT``      connect to a server; loses nothing and pushes back
``tcpin:HOST:PORT``    serve many clients
``serial:DEVICE:BAUD`` a serial line; opened again when it was unplugged
``memory:NAME``        two ends of one name inside a process, for tests
=====================  ======================================================================
"""

from typing import NamedTuple

from mavlink_io.transport.base import (
    MAX_DATAGRAM,
    SPIN_S,
    AddressError,
    Handle,
    LinkLostError,
    Transport,
    wait,
)
from mavlink_io.transport.memory import MemoryTransport
from mavlink_io.transport.serial_line import SerialTransport
from mavlink_io.transport.tcp import SEND_TIMEOUT_S, TcpClient, TcpServer
from mavlink_io.transport.udp import UdpTransport

__all__ = (
    "MAX_DATAGRAM",
    "SEND_TIMEOUT_S",
    "SPIN_S",
    "AddressError",
    "Handle",
    "LinkLostError",
    "MemoryTransport",
    "SerialTransport",
    "TcpClient",
    "TcpServer",
    "Transport",
    "UdpTransport",
    "baud_rate",
    "open_transport",
    "wait",
)

_KINDS = ("udpin", "udpout", "tcp", "tcpin", "serial", "memory")
_MAX_PORT, _MAX_BAUD = 65_535, (1 << 31) - 1


class _Parts(NamedTuple):
    kind: str
    where: str
    number: int
    """A port, or a baud rate."""


def open_transport(
    address: str, *, awaited: bool = False, patience_s: float = SEND_TIMEOUT_S
) -> Transport:
    """Open the transport that an address names.

    A serial device that does not exist is an error of the address; with ``awaited`` it is waited
    for, as a vehicle waits for its radio. ``patience_s`` is how long a client that does not read
    may hold a TCP link up.

    Raises:
        AddressError: the address is malformed, or its port or device cannot be opened.
    """
    kind, where, number = _parts(address)
    match kind:
        case "memory":
            return MemoryTransport(address, where)
        case "udpin" | "udpout":
            return UdpTransport(address, where, number, bind=kind == "udpin")
        case "tcp":
            return TcpClient(address, where, number, patience_s=patience_s)
        case "tcpin":
            return TcpServer(address, where, number, patience_s=patience_s)
        case _:
            return SerialTransport(address, where, number, awaited=awaited)


def baud_rate(address: str) -> int | None:
    """The baud rate of a serial line's address, None for every other. Raises nothing: of no
    address, None too."""
    try:
        kind, _, number = _parts(address)
    except AddressError:
        return None
    return number if kind == "serial" else None


def _parts(address: str) -> _Parts:
    kind, _, rest = address.partition(":")
    if kind == "memory" and rest:
        return _Parts(kind, rest, 0)
    where, colon, number = rest.rpartition(":")
    if kind not in _KINDS or not colon or not where:
        raise AddressError(
            f"address {address!r}: expected udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT,"
            " tcpin:HOST:PORT, serial:DEVICE:BAUD or memory:NAME"
        )
    least, most, meant = (
        (1, _MAX_BAUD, "baud rate") if kind == "serial" else (0, _MAX_PORT, "port number")
    )
    if not number.isdecimal() or not least <= int(number) <= most:
        raise AddressError(f"address {address!r}: {number!r} is no {meant}")
    if kind != "serial" and not _may_be_host(where):
        raise AddressError(f"address {address!r}: {where!r} is no host name")
    return _Parts(kind, where, int(number))


def _may_be_host(name: str) -> bool:
    """Whether a resolver can be asked for it."""
    try:
        name.encode("idna")
    except UnicodeError:
        return False
    return True
