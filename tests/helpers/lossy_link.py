"""Two ends joined in memory, with a simulated wall clock and selectable losses."""

from collections.abc import Callable
from typing import Any, TypeVar

from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.request import Exchange, ExchangeError, MavlinkId

T = TypeVar("T")

GROUND, VEHICLE = MavlinkId(250, 190), MavlinkId(1, 1)
ATTEMPTS = 5
"""Number of times that an exchange sends its request."""
Lost = Callable[[int, str], bool]
"""Return whether the n-th sent message, which has this name, is lost."""


def nothing(count: int, name: str) -> bool:
    return False


class Wire:
    """One direction: encode sent messages to frames for the other end."""

    def __init__(self, sender: MavlinkId, lost: Lost = nothing) -> None:
        self._sender, self._lost = sender, lost
        self._framer = Framer()
        self._waiting: list[Frame] = []
        self.names: list[str] = []
        self.lost = 0
        """Number of messages since the last one from the other end, for ``settle``."""

    def send(self, name: str, **fields: Any) -> None:
        message = dialect.by_name(name)
        self.names.append(name)
        if self._lost(len(self.names) - 1, name):
            self.lost += 1
        else:
            self._waiting += self._framer.feed(
                encode(message, message.values(**fields), 0, *self._sender)
            )

    def take(self) -> list[Frame]:
        frames, self._waiting = self._waiting, []
        return frames


def settle(
    exchange: Exchange[T],
    up: Wire,
    down: Wire,
    serve: Callable[[Frame, float], None],
    poll: Callable[[float], None],
) -> T:
    """Run an exchange to its end, in steps of 0.1 s of simulated wall time."""
    for tenth in range(2000):
        now_s = tenth * 0.1
        exchange.poll(now_s)
        for frame in up.take():
            serve(frame, now_s)
        poll(now_s)
        for frame in down.take():
            up.lost = down.lost = 0
            exchange.feed(frame)
        if exchange.done:
            return exchange.result()
    raise AssertionError("the exchange never came to an end")


def insist(attempt: Callable[[], T], up: Wire, down: Wire, times: int = 5) -> T:
    """Run an exchange again, as a user does, only if all requests or all answers were lost."""
    for _ in range(times - 1):
        try:
            return attempt()
        except ExchangeError:
            if up.lost + down.lost < ATTEMPTS:
                raise
    return attempt()
