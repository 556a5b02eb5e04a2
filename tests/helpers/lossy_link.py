"""Two ends joined in memory, with a wall clock of their own and a say in what gets lost."""

from collections.abc import Callable
from typing import Any, TypeVar

from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.request import Exchange, ExchangeError, MavlinkId

T = TypeVar("T")

GROUND, VEHICLE = MavlinkId(250, 190), MavlinkId(1, 1)
ATTEMPTS = 5
"""So often an exchange asks before it gives up."""
Lost = Callable[[int, str], bool]
"""Whether the n-th message that is sent, of this name, gets lost."""


def nothing(count: int, name: str) -> bool:
    return False


class Wire:
    """One direction: what is sent becomes frames for the other end."""

    def __init__(self, sender: MavlinkId, lost: Lost = nothing) -> None:
        self._sender, self._lost = sender, lost
        self._framer = Framer()
        self._waiting: list[Frame] = []
        self.names: list[str] = []
        self.lost = 0
        """Messages since something last came down, as ``settle`` counts."""

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
    """Carry an exchange through, a tenth of a second of pretended wall time at a time."""
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
    """The same once more, as a user does, but only where chance took every question of an exchange,
    or its answer."""
    for _ in range(times - 1):
        try:
            return attempt()
        except ExchangeError:
            if up.lost + down.lost < ATTEMPTS:
                raise
    return attempt()
