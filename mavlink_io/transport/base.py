"""What every transport is, and waiting for several at once."""

import os
import select
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Any, Protocol, TypeVar, runtime_checkable

from mavlink_io.clock import wall_s

T = TypeVar("T")

Handle = Any
"""What ``poll`` waits for: a socket or an open serial port."""

Piece = tuple[Hashable, bytes]
"""Bytes and the peer that they came from; no bytes: the peer has left."""

SPIN_S = 5e-3
"""Time for which an eager wait polls before it blocks: many ticks of the other end, so that a third
process in between does not make both ends block. Measured on two idle cores, a round trip takes
80 us between two processes that block and 9 us between two that poll."""
MAX_DATAGRAM = 65_535


_READABLE = select.POLLIN | select.POLLHUP | select.POLLERR
"""Events after which a read does not block: data, the end of a stream, an error to be read."""
_MS_PER_S = 1000.0


class _Latest(threading.local):
    """What ``_ready`` of this thread watched last: a look at the same handles spares the
    registration."""

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self.poller = select.poll()


_latest = _Latest()

_yield_cpu: Callable[[], None] = getattr(os, "sched_yield", lambda: time.sleep(0.0))


class AddressError(ValueError):
    """An address that names no transport; the message says what is wrong and what would be
    right."""


class LinkLostError(ConnectionError):
    """The other end is gone for good."""


class Transport(Protocol):
    """One verb each way. ``receive`` never blocks: ``wait`` does, for several transports at
    once."""

    address: str

    def handles(self) -> Sequence[Handle]:
        """What to wait for now. Asked before every wait: a line that is closed tries to open again
        here."""
        ...

    def send(self, data: bytes) -> None:
        """Send whole frames. Raises LinkLostError when the other end is gone for good."""
        ...

    def receive(self) -> bytes:
        """What has arrived, b"" for nothing. Raises LinkLostError when the other end is gone for
        good."""
        ...

    def close(self) -> None: ...


@runtime_checkable
class SharedTransport(Transport, Protocol):
    """A transport of several peers at once, whose bytes must not be mixed."""

    def receive_from(self) -> Sequence[Piece]:
        """What has arrived, by peer. Raises LinkLostError when the other end is gone for good."""
        ...


def wait(
    transports: Sequence[Transport], timeout_s: float, *, eager: bool = False
) -> list[Transport]:
    """Those of the transports that have something to receive, as soon as one has or the timeout is
    over.

    An `eager` wait polls for its first `SPIN_S` before it blocks, and yields the processor after
    each poll: the other end of a lockstep answers within that time, and waking a process on another
    core would take longer. Where this thread may use one core only, an eager wait blocks at once:
    polling would keep the other end from computing its answer if it runs on the same core.
    """
    handles = {handle: transport for transport in transports for handle in transport.handles()}
    if not handles:
        time.sleep(max(0.0, timeout_s))
        return []
    ready = _ready(handles, 0.0)
    if not ready and eager and _has_several_cores():
        until_s = wall_s() + min(SPIN_S, timeout_s)
        while not ready and wall_s() < until_s:
            _yield_cpu()
            ready = _ready(handles, 0.0)
    if not ready and timeout_s > 0.0:
        ready = _ready(handles, timeout_s)
    return list(dict.fromkeys(handles[handle] for handle in ready))


def _has_several_cores() -> bool:
    """Return whether this thread may use more than one core, as its affinity is now."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0)) > 1
    return (os.cpu_count() or 1) > 1


def _ready(handles: Iterable[Handle], timeout_s: float) -> list[Handle]:
    """Return the handles that can be read, waiting for the first at most ``timeout_s``.

    The time is rounded up to 1 ms. ``poll`` and not ``select``: a process with many open files has
    handles that ``select`` refuses (1,024 and above).
    """
    by_number = {handle.fileno(): handle for handle in handles}
    numbers = list(by_number)
    if numbers != _latest.numbers:
        poller = select.poll()
        for number in numbers:
            poller.register(number, _READABLE)
        _latest.numbers, _latest.poller = numbers, poller
    return [by_number[number] for number, _ in _latest.poller.poll(timeout_s * _MS_PER_S)]


def readable(handle: Handle) -> bool:
    """Return whether a read from ``handle`` would not block."""
    return bool(_ready((handle,), 0.0))


def writable(handle: Handle, timeout_s: float) -> bool:
    """Return whether ``handle`` takes data, waiting for it at most ``timeout_s``."""
    poller = select.poll()
    poller.register(handle, select.POLLOUT)
    return bool(poller.poll(timeout_s * _MS_PER_S))


def open_or_raise(address: str, opener: Callable[[], T]) -> T:
    """What ``opener`` gives; where it fails, an AddressError that names the address."""
    try:
        return opener()
    except OSError as error:
        raise AddressError(f"address {address!r}: {error}") from None
