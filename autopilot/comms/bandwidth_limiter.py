"""What waits for a line that is slow: in what order it leaves, and how much of it at a time.

Answers are vital: none is ever dropped. Of telemetry only the newest of each kind waits, for an old
attitude is worth nothing. Bulk, such as a log that is fetched, shares what is left with telemetry,
and is made only as fast as it leaves."""

from collections import deque
from collections.abc import Callable, Hashable
from typing import NamedTuple

from mavlink_io.codec import LARGEST_FRAME

MAX_LINE_SHARE = 0.7
"""Of a line's bytes a second: what else it carries, and a clock that is a little off, need the
rest."""
BITS_PER_BYTE = 10
"""8N1: a start bit, eight of data, a stop bit."""
BURST_S = 0.1
"""What was not used for so long may still be used at once."""


class Waiting(NamedTuple):
    """A frame that is not made yet: its sequence number and signature are those of the moment it
    leaves."""

    largest_bytes: int
    encode: Callable[[], bytes]


class Budget:
    """A token bucket on the wall clock: over any time of T seconds at most ``burst_bytes + T *
    bytes_per_s`` leave."""

    def __init__(self, bytes_per_s: float) -> None:
        self.bytes_per_s = bytes_per_s
        self.burst_bytes = max(LARGEST_FRAME, BURST_S * bytes_per_s)
        self._left = self.burst_bytes
        self._time_s: float | None = None

    def left(self, now_s: float) -> float:
        """Bytes that may leave now."""
        if self._time_s is not None:
            self._left = min(
                self.burst_bytes, self._left + self.bytes_per_s * (now_s - self._time_s)
            )
        self._time_s = now_s
        return self._left

    def spend(self, count: int) -> None:
        self._left -= count


class Queue:
    """What waits. Vital frames leave first and in order; then telemetry and bulk, byte for byte in
    turn."""

    def __init__(self) -> None:
        self._vital: deque[Waiting] = deque()
        self._bulk: deque[Waiting] = deque()
        self._telemetry: dict[Hashable, Waiting] = {}
        self._bulk_lead = 0
        """Bytes of bulk that left beyond those of telemetry; what one of them did not want is soon
        forgotten."""
        self.promised_bytes = 0
        """An upper bound of what waits and will not be dropped."""

    def __len__(self) -> int:
        return len(self._vital) + len(self._bulk) + len(self._telemetry)

    def add_vital(self, waiting: Waiting) -> None:
        self._vital.append(waiting)
        self.promised_bytes += waiting.largest_bytes

    def add_bulk(self, waiting: Waiting) -> None:
        self._bulk.append(waiting)
        self.promised_bytes += waiting.largest_bytes

    def add_telemetry(self, kind: Hashable, waiting: Waiting) -> None:
        """Takes the place of what waits of the same kind."""
        self._telemetry[kind] = waiting

    def take(self, budget: float) -> bytes | None:
        """The next frame, where it is sure to fit ``budget`` bytes; None otherwise, and where
        nothing waits."""
        if self._vital:
            return self._redeem(self._vital) if self._vital[0].largest_bytes <= budget else None
        if self._bulk and (not self._telemetry or self._bulk_lead <= 0):
            return self._take_bulk() if self._bulk[0].largest_bytes <= budget else None
        if self._telemetry:
            kind = next(iter(self._telemetry))
            return (
                self._take_telemetry(kind)
                if self._telemetry[kind].largest_bytes <= budget
                else None
            )
        return None

    def clear(self) -> None:
        for waiting in (self._vital, self._bulk, self._telemetry):
            waiting.clear()
        self.promised_bytes = 0

    def _redeem(self, promised: deque[Waiting]) -> bytes:
        waiting = promised.popleft()
        self.promised_bytes -= waiting.largest_bytes
        return waiting.encode()

    def _take_bulk(self) -> bytes:
        frame = self._redeem(self._bulk)
        self._bulk_lead = min(LARGEST_FRAME, self._bulk_lead + len(frame))
        return frame

    def _take_telemetry(self, kind: Hashable) -> bytes:
        frame = self._telemetry.pop(kind).encode()
        self._bulk_lead = max(-LARGEST_FRAME, self._bulk_lead - len(frame))
        return frame
