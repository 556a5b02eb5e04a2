"""Received frames of one link that wait to be processed: one queue per sender, served in turn.

A sender that floods the link fills its own queue. The messages of every other sender are processed
in the next round, and each sender's messages stay in order.
"""

from collections import deque
from collections.abc import Hashable

from mavlink_io.codec import Frame

MAX_SENDER_FRAMES = 2000
"""Maximum number of waiting frames of one sender: more than one datagram holds."""
MAX_SENDERS = 32
"""Number of queues per peer; further senders of the peer share a queue."""
_OTHERS = 0, 0
"""System and component of the shared queue; no sender has them."""

_Key = tuple[Hashable, int, int]


class Inbox:
    """Queues of received frames by peer and sender."""

    def __init__(self) -> None:
        self._queues: dict[_Key, deque[Frame]] = {}
        self._senders: dict[Hashable, int] = {}
        """Number of queues of each peer."""
        self.dropped = 0
        """Number of frames of senders with too many waiting ones."""

    def __bool__(self) -> bool:
        """Return whether a frame waits."""
        return bool(self._queues)

    def __len__(self) -> int:
        """Return the number of waiting frames."""
        return sum(map(len, self._queues.values()))

    def add(self, peer: Hashable, frame: Frame) -> None:
        """Add a frame; drop it if too many of its sender wait."""
        key = peer, frame.system, frame.component
        if key not in self._queues and self._senders.get(peer, 0) >= MAX_SENDERS:
            key = peer, *_OTHERS
        queue = self._queues.get(key)
        if queue is None:
            queue = self._queues[key] = deque()
            self._senders[peer] = self._senders.get(peer, 0) + 1
        if len(queue) >= MAX_SENDER_FRAMES:
            self.dropped += 1
        else:
            queue.append(frame)

    def pop(self) -> Frame:
        """Return the next frame of the sender that was served least recently."""
        key = next(iter(self._queues))
        queue = self._queues.pop(key)
        frame = queue.popleft()
        if queue:
            self._queues[key] = queue
        else:
            self._forget(key[0])
        return frame

    def clear(self) -> None:
        """Drop all frames."""
        self._queues.clear()
        self._senders.clear()

    def _forget(self, peer: Hashable) -> None:
        """Count one queue less of a peer."""
        self._senders[peer] -= 1
        if not self._senders[peer]:
            del self._senders[peer]
