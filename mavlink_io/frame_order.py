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
"""Wall time after the newest frame within which a lower number is late; later the sender may have
started again."""


class FrameOrder:
    """Newest sequence number of one sender on one link."""

    def __init__(self) -> None:
        self._newest, self._newest_s = 0, float("-inf")

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
        frames_late = self._newest - sequence & 0xFF
        if now_s - self._newest_s < MAX_LATE_S and 0 < frames_late <= MAX_FRAMES_LATE:
            return True
        self._newest, self._newest_s = sequence, now_s
        return False


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
    """Newest sequence numbers of the clients of a server."""

    def __init__(self) -> None:
        self._orders: dict[Hashable, FrameOrder] = {}

    def is_late(self, client: Hashable, sequence: int, now_s: float) -> bool:
        """Return whether a frame is older than the newest one of its client; see `FrameOrder`.

        Parameters
        ----------
        client : Hashable
            The client.
        sequence : int
            Sequence number of the frame, modulo 256.
        now_s : float
            Wall clock, in seconds.

        Returns
        -------
        bool
            Whether a newer frame of the client has arrived before.
        """
        if client not in self._orders:
            while len(self._orders) >= MAX_CLIENTS:
                del self._orders[next(iter(self._orders))]
            self._orders[client] = FrameOrder()
        return self._orders[client].is_late(sequence, now_s)
