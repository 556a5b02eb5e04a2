"""The interface of transports, and waiting for several of them at once."""

import contextlib
import os
import resource
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

from mavlink_io.clock import wall_s
from mavlink_io.errors import ErrorCode, InputError, OperationError

T = TypeVar("T")

Handle = Any
"""An object with a file descriptor that ``poll`` can wait for: a socket or an open serial port."""

Piece = tuple[Hashable, bytes]
"""A peer and the bytes that it sent; empty bytes mean that the peer has disconnected."""

SPIN_S = 5e-3
"""Time for which an eager wait polls before it blocks, in seconds.

It is many ticks of the other end long, so that a third process in between does not make both ends
block. Measured on two idle cores, a round trip takes 80 us between two processes that block and
9 us between two that poll."""
DECISION_S = 0.1
"""Time between two decisions whether to poll or to block, in seconds."""
MAX_PREEMPTIONS_PER_S = 30.0
"""Rate at which other programs take the core of this thread, above which it blocks.

Kernel threads take it a few times a second on an idle machine; a program that computes takes it
hundreds of times from a thread that polls."""
MAX_DATAGRAM = 65_535
"""Maximum number of bytes that one receive reads."""

_READABLE = select.POLLIN | select.POLLHUP | select.POLLERR
"""Events after which a read does not block: data, the end of a stream, an error."""
_MS_PER_S = 1000.0


class _PollerCache(threading.local):
    """The file descriptors of the last ``_ready`` of this thread, with their registered poller."""

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self.poller = select.poll()


_cache = _PollerCache()


class _WaitMode(threading.local):
    """Whether an eager wait of this thread polls: only while no other program wants its core."""

    def __init__(self) -> None:
        self.decided_s = wall_s()
        self.preemptions = _preemptions()
        self.may_poll = _has_several_cores()


def _preemptions() -> int:
    """Return how often another program has taken the core of this thread."""
    return resource.getrusage(_THREAD).ru_nivcsw


def _has_several_cores() -> bool:
    """Return whether the affinity of this thread allows more than one core now."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0)) > 1
    return (os.cpu_count() or 1) > 1


_THREAD = getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF)
_mode = _WaitMode()

_yield_cpu: Callable[[], None] = getattr(os, "sched_yield", lambda: time.sleep(0.0))


class AddressError(InputError):
    """The address is malformed or cannot be opened; the text says why and what is expected."""

    code = ErrorCode.ADDRESS


class LinkLostError(OperationError, ConnectionError):
    """The other end is gone and cannot come back."""

    code = ErrorCode.LINK_LOST


class Transport(Protocol):
    """A link that sends and receives bytes.

    ``receive`` never blocks; use ``wait`` to wait for several transports at once.
    """

    address: str
    """The address that the transport was opened with."""

    def handles(self) -> Sequence[Handle]:
        """Return the handles to wait for now; a closed line tries to reopen here.

        Call it before every wait, because the handles change.
        """
        ...

    def send(self, data: bytes) -> None:
        """Send whole frames.

        Parameters
        ----------
        data : bytes
            One or more complete frames.

        Raises
        ------
        LinkLostError
            The other end is gone.
        """
        ...

    def receive(self) -> bytes:
        """Return the bytes that have arrived, b"" if none. Raises LinkLostError."""
        ...

    def close(self) -> None:
        """Close the link; do not use it afterwards."""
        ...


@runtime_checkable
class SharedTransport(Transport, Protocol):
    """A transport with several peers, whose bytes must be kept apart."""

    def receive_from(self) -> Sequence[Piece]:
        """Return the bytes that have arrived from each peer. Raises LinkLostError."""
        ...


class Peer(NamedTuple):
    """A socket and the only address that it exchanges datagrams with."""

    number: int
    """File descriptor; its reads block for at most `SPIN_S`."""
    address: tuple[str, int] | None
    """Address of the peer; None if the socket is connected to it."""


@runtime_checkable
class LockstepTransport(Transport, Protocol):
    """A transport of datagrams whose next one can be waited for in the call that reads it."""

    eager: bool
    """Whether ``receive`` and ``receive_from`` wait eagerly for a datagram, at most `SPIN_S`."""

    def peer(self) -> Peer | None:
        """Return socket and peer for compiled code; None unless there is exactly one peer."""
        ...

    def record_sender(self, sender: tuple[str, int] | None) -> bool:
        """Record the sender of a datagram that compiled code has read; return whether to use it.

        None is the peer that ``peer`` has returned.
        """
        ...


def wait(
    transports: Sequence[Transport], timeout_s: float, *, eager: bool = False
) -> list[Transport]:
    """Wait until a transport has something to receive, or the timeout is over.

    Parameters
    ----------
    transports : sequence of Transport
        Transports to wait for.
    timeout_s : float
        Maximum wall time, in seconds; 0 does not wait.
    eager : bool
        Whether to poll for the first `SPIN_S` before blocking, which shortens the reaction time.

    Returns
    -------
    list of Transport
        The transports that have something to receive; empty after a timeout.

    Notes
    -----
    An eager wait yields the processor after each poll. The other end of a lockstep link answers
    within `SPIN_S`, and waking a process on another core takes longer. An eager wait blocks at once
    if this thread may use one core only, or if another program wants its core: polling would keep
    the other end, or that program, from computing.
    """
    handles = {handle: transport for transport in transports for handle in transport.handles()}
    if not handles:
        time.sleep(max(0.0, timeout_s))
        return []
    ready = _ready(handles, 0.0)
    if not ready and eager and _may_poll():
        until_s = wall_s() + min(SPIN_S, timeout_s)
        while not ready and wall_s() < until_s:
            _yield_cpu()
            ready = _ready(handles, 0.0)
    if not ready and timeout_s > 0.0:
        ready = _ready(handles, timeout_s)
    return list(dict.fromkeys(handles[handle] for handle in ready))


def spin_s() -> float:
    """Return the time for which an eager wait polls now, in seconds; 0 if it blocks."""
    return SPIN_S if _may_poll() else 0.0


def _may_poll() -> bool:
    """Return whether polling takes a core from nobody: there are several, and this one is free."""
    now_s = wall_s()
    elapsed_s = now_s - _mode.decided_s
    if elapsed_s > DECISION_S:
        preemptions = _preemptions()
        core_is_free = preemptions - _mode.preemptions <= MAX_PREEMPTIONS_PER_S * elapsed_s
        _mode.may_poll = core_is_free and _has_several_cores()
        _mode.decided_s, _mode.preemptions = now_s, preemptions
    return _mode.may_poll


def _ready(handles: Iterable[Handle], timeout_s: float) -> list[Handle]:
    """Return the handles that can be read; wait at most ``timeout_s``, rounded up to 1 ms.

    It uses ``poll``, because ``select`` refuses file descriptors of 1,024 and above.
    """
    by_number = {handle.fileno(): handle for handle in handles}
    numbers = list(by_number)
    if numbers != _cache.numbers:
        poller = select.poll()
        for number in numbers:
            poller.register(number, _READABLE)
        _cache.numbers, _cache.poller = numbers, poller
    return [by_number[number] for number, _ in _cache.poller.poll(timeout_s * _MS_PER_S)]


def set_receive_timeout(datagrams: socket.socket) -> None:
    """Make a blocking read of a socket give up after `SPIN_S`, where the system can do that."""
    with contextlib.suppress(OSError):
        limit = struct.pack("ll", 0, round(SPIN_S * 1e6))  # struct timeval
        datagrams.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)


def read_eagerly(read: Callable[[int, int], T]) -> T:
    """Return what ``recv`` or ``recvfrom`` of a socket reads within `SPIN_S`.

    The socket must be a blocking one with `set_receive_timeout`. Raises BlockingIOError after the
    time.
    """
    polling_s = spin_s()
    if not polling_s:
        return read(MAX_DATAGRAM, 0)
    until_s = wall_s() + polling_s
    while True:
        try:
            return read(MAX_DATAGRAM, socket.MSG_DONTWAIT)
        except BlockingIOError:
            if wall_s() >= until_s:
                raise
            _yield_cpu()


def readable(handle: Handle) -> bool:
    """Return whether a read from ``handle`` would not block."""
    return bool(_ready((handle,), 0.0))


def writable(handle: Handle, timeout_s: float) -> bool:
    """Return whether ``handle`` accepts data; wait for it at most ``timeout_s``."""
    poller = select.poll()
    poller.register(handle, select.POLLOUT)
    return bool(poller.poll(timeout_s * _MS_PER_S))


def open_or_raise(address: str, opener: Callable[[], T]) -> T:
    """Return the result of ``opener``; turn an OSError into an AddressError with the address."""
    try:
        return opener()
    except OSError as error:
        raise AddressError(f"address {address!r}: {error}") from None
