"""One request of a MAVLink service and its answer, over a link that may lose either.

An exchange has no loop of its own: the owner of the receive loop feeds it the received frames and
polls it. The same exchange therefore serves a command-line tool and a reader thread.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

from mavlink_io.codec import Frame
from mavlink_io.errors import ErrorCode, OperationError
from mavlink_io.frame_order import FrameOrder

T = TypeVar("T")

MAX_REPEATS_S = 60.0
"""Wall time in which a peer may answer without anything new, such as the same items again; then the
exchange fails. Each of these answers starts its retry timeout again, which would go on for ever."""


class MavlinkId(NamedTuple):
    """System and component id of a MAVLink participant."""

    system: int
    component: int


class Send(Protocol):
    """Function that sends one message by name and fields, such as ``Endpoint.send``."""

    def __call__(self, name: str, **fields: Any) -> None:
        """Send the message ``name`` with its fields."""


class Client(NamedTuple):
    """A client of a server, and the function that sends to it.

    Two programs may have the same ids, as two MAVSDK programs do. The send function, which is one
    object per link, then distinguishes them.
    """

    mavlink_id: MavlinkId
    send: Send


RoomBytes = Callable[[], int]
"""Return how many bytes of bulk data (logs, files) a link accepts now."""


class ExchangeError(OperationError):
    """The peer refused the request or did not answer; the text contains the request and reason."""

    code = ErrorCode.EXCHANGE_FAILED


class Exchange(ABC, Generic[T]):
    """Send a request, repeat it until the peer answers, and end with a result or an error.

    Parameters
    ----------
    send : Send
        Function that sends a message to the peer.
    own : MavlinkId
        Ids of this program. Answers to other receivers are ignored.
    peer : MavlinkId
        Ids of the participant that answers.
    retry_s : float
        Wall time without an answer after which the request is sent again, in seconds.
    attempts : int
        Number of times that a request is sent before the exchange fails.
    """

    message_names: ClassVar[frozenset[str]]
    """Names of the messages that can be an answer."""
    in_order: ClassVar[bool] = False
    """Whether frames that the link has delivered late are ignored (``frame_order``)."""
    max_repeats_s: ClassVar[float] = MAX_REPEATS_S
    """Minimum wall time with answers, but without anything new, after which the exchange fails."""

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
        self._retry_s, self._attempts, self._attempts_left = retry_s, attempts, attempts
        self._due_s = self._now_s = -math.inf
        self._order = FrameOrder()
        self._has_progressed = self._has_news = False
        self._news_s: float | None = None
        """Wall clock at the first poll, or at the poll after the last new answer."""
        self._result: T | None = None
        self._error = ""
        self.done = False
        """Whether the exchange has ended, with a result or an error."""
        self.timed_out = False
        """Whether the peer has not answered any attempt of a request."""

    def repeat_every(self, retry_s: float, attempts: int) -> None:
        """Repeat the request less often than its default but more times, over a slow, lossy link.

        Parameters
        ----------
        retry_s : float
            Wall time without an answer after which the request is sent again, in seconds.
        attempts : int
            Number of times that a request is sent before the exchange fails.
        """
        self._retry_s = max(self._retry_s, retry_s)
        self._attempts = self._attempts_left = max(self._attempts, attempts)

    def poll(self, now_s: float) -> None:
        """Send the request, or repeat it if it is due.

        Parameters
        ----------
        now_s : float
            Wall clock (``clock.wall_s``), in seconds.
        """
        self._now_s = now_s
        if self.done:
            return
        if self._has_news or self._news_s is None:
            self._news_s = now_s
        elif self._has_progressed and now_s - self._news_s > self._repeats_limit_s():
            self._fail(f"{self._describe()}: no new answer for {now_s - self._news_s:.0f} s")
            return
        if self._has_progressed:
            self._has_progressed = self._has_news = False
            self._attempts_left, self._due_s = self._attempts, now_s + self._retry_s
        if now_s < self._due_s:
            return
        if self._attempts_left:
            self._attempts_left -= 1
            self._due_s = now_s + self._retry_s
            self._send_request()
        else:
            self.timed_out = True
            self._fail(f"no answer to {self._describe()} after {self._attempts} attempts")

    def feed(self, frame: Frame) -> None:
        """Process a received frame; ignore it if it is not an answer from the peer.

        Parameters
        ----------
        frame : Frame
            Any received frame.
        """
        if self.done or (frame.system, frame.component) != self._peer:
            return
        if self._is_late(frame) or frame.name not in self.message_names:
            return
        message = frame.decode()
        if addressed_to(message, self._own):
            self._handle_message(frame.name, message)

    def _is_late(self, frame: Frame) -> bool:
        """Return whether a frame of the peer is ignored because the link has delivered it late."""
        return self.in_order and self._order.is_late(frame.sequence, self._now_s)

    def result(self) -> T:
        """Return the result.

        Raises
        ------
        ExchangeError
            The exchange failed or is not done.
        """
        if self._error or not self.done:
            raise ExchangeError(self._error or f"{self._describe()} is not answered yet")
        return self._result  # type: ignore[return-value]

    @abstractmethod
    def _send_request(self) -> None:
        """Send the request, or the part of it that is not answered yet."""

    @abstractmethod
    def _handle_message(self, name: str, message: Any) -> None:
        """Process one answer of the peer."""

    @abstractmethod
    def _describe(self) -> str:
        """Return a noun phrase for the request, for error messages."""

    def _note_progress(self, *, is_new: bool = True) -> None:
        """Restart the retry timeout and the count of attempts at the next poll.

        An answer that only repeats an earlier one is not new.
        """
        self._has_progressed = True
        self._has_news |= is_new

    def _repeats_limit_s(self) -> float:
        """Return the wall time after which answers without anything new end the exchange."""
        return max(self.max_repeats_s, self._retry_s * self._attempts)

    def _finish(self, result: T) -> None:
        """End the exchange with a result."""
        self._result, self.done = result, True

    def _fail(self, reason: str) -> None:
        """End the exchange with an error."""
        self._error, self.done = reason, True

    def _send_to_peer(self, name: str, **fields: Any) -> None:
        """Send a message that is addressed to the peer."""
        self._send(
            name, target_system=self._peer.system, target_component=self._peer.component, **fields
        )


def addressed_to(message: Any, receiver: MavlinkId) -> bool:
    """Return whether a message is addressed to a participant.

    Parameters
    ----------
    message : namedtuple
        Decoded message.
    receiver : MavlinkId
        The participant.

    Returns
    -------
    bool
        True if the message has the participant's ids as target, is a broadcast (0), or has no
        target fields.
    """
    system, component = (
        getattr(message, "target_system", 0),
        getattr(message, "target_component", 0),
    )
    return system in (0, receiver.system) and component in (0, receiver.component)
