"""Send queue of a slow line: order of the frames and bytes per second.

Replies have priority and are never dropped. Of telemetry only the newest frame of each
kind waits, because an old attitude is of no use. Bulk data, such as a log download, shares the
remaining rate equally with telemetry; services produce it only as fast as the line sends it.
"""

from collections import deque
from collections.abc import Callable, Hashable
from typing import NamedTuple

from mavlink_io.codec import MAX_FRAME_BYTES

MAX_LINE_SHARE = 0.7
"""Share of the bytes per second of a line that is used.

The rest is for other senders on the line and for the tolerance of the clocks."""
BITS_PER_BYTE = 10
"""Format 8N1: one start bit, eight data bits, one stop bit."""
BURST_S = 0.1
"""Duration of unused rate that may be sent at once."""


class QueuedFrame(NamedTuple):
    """A frame in the queue, encoded when it is sent: that sets sequence number and signature."""

    max_bytes: int
    encode: Callable[[], bytes]


class TokenBucket:
    """A token bucket on the wall clock.

    In any interval of T seconds at most ``burst_bytes + T * bytes_per_s`` are sent.
    """

    def __init__(self, bytes_per_s: float) -> None:
        self.bytes_per_s = bytes_per_s
        self.burst_bytes = max(MAX_FRAME_BYTES, BURST_S * bytes_per_s)
        self._available_bytes = self.burst_bytes
        self._time_s: float | None = None

    def available_bytes(self, now_s: float) -> float:
        """Return the number of bytes that may be sent now."""
        if self._time_s is not None:
            self._available_bytes = min(
                self.burst_bytes, self._available_bytes + self.bytes_per_s * (now_s - self._time_s)
            )
        self._time_s = now_s
        return self._available_bytes

    def spend(self, count: int) -> None:
        """Subtract bytes that were sent."""
        self._available_bytes -= count


class SendQueue:
    """Frames to send: replies first and in order, then equal shares of telemetry and bulk."""

    def __init__(self) -> None:
        self._replies: deque[QueuedFrame] = deque()
        self._bulk: deque[QueuedFrame] = deque()
        self._telemetry: dict[Hashable, QueuedFrame] = {}
        self._bulk_excess_bytes = 0
        """Bytes of bulk sent minus bytes of telemetry sent, limited to one frame either way."""
        self.committed_bytes = 0
        """Upper bound of the bytes in the queue that are never dropped."""

    def __len__(self) -> int:
        """Return the number of frames in the queue."""
        return len(self._replies) + len(self._bulk) + len(self._telemetry)

    def add_reply(self, entry: QueuedFrame) -> None:
        """Queue a frame that is sent first and never dropped."""
        self._replies.append(entry)
        self.committed_bytes += entry.max_bytes

    def add_bulk(self, entry: QueuedFrame) -> None:
        """Queue a frame of a log, a file or a list."""
        self._bulk.append(entry)
        self.committed_bytes += entry.max_bytes

    def add_telemetry(self, kind: Hashable, entry: QueuedFrame) -> None:
        """Queue telemetry; it replaces a waiting frame of the same kind."""
        self._telemetry[kind] = entry

    def pop(self, budget_bytes: float) -> bytes | None:
        """Return the next frame; None when it could exceed the budget or the queue is empty."""
        if self._replies:
            fits = self._replies[0].max_bytes <= budget_bytes
            return self._pop_committed(self._replies) if fits else None
        if self._bulk and (not self._telemetry or self._bulk_excess_bytes <= 0):
            return self._pop_bulk() if self._bulk[0].max_bytes <= budget_bytes else None
        if self._telemetry:
            kind = next(iter(self._telemetry))
            return (
                self._pop_telemetry(kind)
                if self._telemetry[kind].max_bytes <= budget_bytes
                else None
            )
        return None

    def clear(self) -> None:
        """Drop all frames."""
        for frames in (self._replies, self._bulk, self._telemetry):
            frames.clear()
        self.committed_bytes = 0

    def _pop_committed(self, frames: deque[QueuedFrame]) -> bytes:
        """Encode the first of replies or bulk frames."""
        entry = frames.popleft()
        self.committed_bytes -= entry.max_bytes
        return entry.encode()

    def _pop_bulk(self) -> bytes:
        """Encode the first bulk frame and count its bytes."""
        frame = self._pop_committed(self._bulk)
        self._bulk_excess_bytes = min(MAX_FRAME_BYTES, self._bulk_excess_bytes + len(frame))
        return frame

    def _pop_telemetry(self, kind: Hashable) -> bytes:
        """Encode the telemetry frame of a kind and count its bytes."""
        frame = self._telemetry.pop(kind).encode()
        self._bulk_excess_bytes = max(-MAX_FRAME_BYTES, self._bulk_excess_bytes - len(frame))
        return frame
