"""Recognition of frames that a link has delivered late, by the sequence numbers of their sender.

A repeated or delayed MISSION_COUNT, MISSION_ITEM_INT or MISSION_ACK of an earlier upload cannot be
distinguished from one of the present upload by its content, nor can an old PARAM_SET.
"""

from collections.abc import Hashable

MAX_CLIENTS = 16
"""Number of clients whose frames are put in order; the client that came first is forgotten."""
MAX_FRAMES_LATE = 32
"""Largest number of frames by which a frame is recognised as late.

A gap of more than 255 minus this number of frames looks the same: then one frame too many is
ignored, which its protocol repeats."""
MAX_LATE_S = 2.0
"""Largest delay of a frame on a link, wall time. A lower number that would have taken longer is
that of a sender that has started again."""


class FrameOrder:
    """Newest sequence numbers of one sender on one link, with their times of arrival."""

    def __init__(self) -> None:
        self._newest: list[tuple[int, float]] = []

    def is_late(self, sequence: int, now_s: float) -> bool:
        """Return whether a frame is older than the newest one, and note it otherwise.

        Parameters
        ----------
        sequence : int
            Sequence number of the frame, modulo 256. A sender that does not count has no late
            frames.
        now_s : float
            Wall clock, in seconds.

        Returns
        -------
        bool
            Whether a newer frame of the sender has arrived before.
        """
        for newer, arrived_s in self._newest:
            if 0 < newer - sequence & 0xFF <= MAX_FRAMES_LATE:
                # the first of those that were sent after it: it is late by more than this time
                if now_s - arrived_s < MAX_LATE_S:
                    return True
                self.restart(sequence, now_s)
                return False
        recent = [one for one in self._newest if 0 < sequence - one[0] & 0xFF <= MAX_FRAMES_LATE]
        self._newest = [*recent, (sequence, now_s)]
        return False

    def restart(self, sequence: int, now_s: float) -> None:
        """Forget all frames before one, the first of a sender that has started again.

        Parameters
        ----------
        sequence : int
            Sequence number of the frame, modulo 256.
        now_s : float
            Wall clock, in seconds.
        """
        self._newest = [(sequence, now_s)]


class FrameCounter:
    """Positions of the frames of one sender in the order in which they were sent."""

    def __init__(self) -> None:
        self._newest: int | None = None

    def position(self, sequence: int) -> int:
        """Return the position of a frame.

        Parameters
        ----------
        sequence : int
            Sequence number of the frame, modulo 256.

        Returns
        -------
        int
            Greater for a frame that was sent later, if less than 128 frames were lost or overtaken
            between it and the frame before.
        """
        newest = sequence if self._newest is None else self._newest
        position = newest + ((sequence - newest + 128) & 0xFF) - 128
        self._newest = max(newest, position)
        return position


class FrameOrders:
    """Orders of the frames of the clients of a server."""

    def __init__(self) -> None:
        self._orders: dict[Hashable, FrameOrder] = {}

    def of(self, client: Hashable) -> FrameOrder:
        """Return the order of the frames of a client.

        Parameters
        ----------
        client : Hashable
            The client.

        Returns
        -------
        FrameOrder
            The same object at every call, as long as the client is one of the last `MAX_CLIENTS`.
        """
        if client not in self._orders:
            while len(self._orders) >= MAX_CLIENTS:
                del self._orders[next(iter(self._orders))]
            self._orders[client] = FrameOrder()
        return self._orders[client]
