"""One question of a MAVLink service and its answer, over a link that may lose either.

An exchange has no loop of its own: whoever owns the receive loop feeds it the frames that arrive
and polls it now and then. So it serves a blocking command-line tool (``run``) and a reader thread
alike."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import wait

T = TypeVar("T")


class MavlinkId(NamedTuple):
    """A MAVLink participant."""

    system: int
    component: int


class Send(Protocol):
    """How a message leaves: ``Endpoint.send``, or anything of the same shape."""

    def __call__(self, name: str, **fields: Any) -> None: ...


class Client(NamedTuple):
    """Who asks a server, and how to answer. Two programs may bear the same ids, as any two of
    MAVSDK do: then the way back, which is the same for one link, tells them apart."""

    party: MavlinkId
    send: Send


RoomBytes = Callable[[], int]
"""How many bytes of bulk - a log, a file - a link takes now."""


class ExchangeError(RuntimeError):
    """The other end refused, or never answered; the message says which and why."""


class Exchange(ABC, Generic[T]):
    """Asks, repeats the question while the other end is silent, and ends with a result or a
    reason."""

    hears: ClassVar[frozenset[str]]
    """The messages that can answer."""

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        *,
        retry_s: float = 1.0,
        attempts: int = 5,
    ) -> None:
        self._send, self._own, self._peer = send, MavlinkId(*own), MavlinkId(*peer)
        self._retry_s, self._attempts, self._left = retry_s, attempts, attempts
        self._due_s = -math.inf
        self._advanced = False
        self._result: T | None = None
        self._error = ""
        self.done = False

    def poll(self, now_s: float) -> None:
        """Ask, or ask again, when it is time to. ``now_s`` is the wall clock."""
        if self.done:
            return
        if self._advanced:
            self._advanced, self._left, self._due_s = False, self._attempts, now_s + self._retry_s
        if now_s < self._due_s:
            return
        if self._left:
            self._left -= 1
            self._due_s = now_s + self._retry_s
            self._ask()
        else:
            self._fail(f"no answer to {self._question()} after {self._attempts} attempts")

    def feed(self, frame: Frame) -> None:
        """Take note of a received frame; frames that are no answer are ignored."""
        if (
            self.done
            or (frame.system, frame.component) != self._peer
            or frame.name not in self.hears
        ):
            return
        message = frame.decode()
        if addressed_to(message, self._own):
            self._hear(frame.name, message)

    def result(self) -> T:
        """What was asked for. Raises ExchangeError when it failed, or is not done."""
        if self._error or not self.done:
            raise ExchangeError(self._error or f"{self._question()} is not answered yet")
        return self._result  # type: ignore[return-value]

    @abstractmethod
    def _ask(self) -> None:
        """Send the question, or the part of it that is still open."""

    @abstractmethod
    def _hear(self, name: str, message: Any) -> None:
        """Take one answer."""

    @abstractmethod
    def _question(self) -> str:
        """What was asked, in words for an error."""

    def _progress(self) -> None:
        """The other end is alive: count the silence from the next poll on."""
        self._advanced = True

    def _finish(self, result: T) -> None:
        self._result, self.done = result, True

    def _fail(self, reason: str) -> None:
        self._error, self.done = reason, True

    def _post(self, name: str, **fields: Any) -> None:
        self._send(
            name, target_system=self._peer.system, target_component=self._peer.component, **fields
        )


def addressed_to(message: Any, party: MavlinkId) -> bool:
    """Whether a message is for ``party``: it names it, broadcasts, or has no address at all."""
    system, component = (
        getattr(message, "target_system", 0),
        getattr(message, "target_component", 0),
    )
    return system in (0, party.system) and component in (0, party.component)


def run(exchange: Exchange[T], endpoint: Endpoint, timeout_s: float = 30.0) -> T:
    """Carry an exchange through on an endpoint that nobody else reads. Raises ExchangeError,
    LinkLostError."""
    deadline_s = wall_s() + timeout_s
    while not exchange.done:
        now_s = wall_s()
        if now_s > deadline_s:
            raise ExchangeError(f"not finished within {timeout_s:g} s")
        exchange.poll(now_s)
        wait([endpoint.transport], 0.02)
        for frame in endpoint.receive():
            exchange.feed(frame)
    return exchange.result()
