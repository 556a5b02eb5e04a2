"""Count of the frames that a link has lost, by the gaps in the sequence numbers of each sender.

A frame that the link has delivered late, or twice, is no gap: it was counted as lost when a later
one arrived, and counts no longer. A sender that restarts counts its frames from 0 again; this gap
is no loss. A restart is recognised by vehicle time that begins again, some frames later.
"""

from mavlink_io import dialect
from mavlink_io.frame_order import MAX_FRAMES_LATE
from mavlink_io.logging.ros1 import time_reader
from mavlink_io.vehicle_clock import VehicleClock


class FrameLoss:
    """Number of frames of one sender that did not arrive."""

    def __init__(self) -> None:
        self.lost = 0
        """Number of lost frames."""
        self._expected: int | None = None
        self._missing: set[int] = set()
        """Numbers of the lost frames that may still arrive."""
        self._timed: tuple[int, bytes] | None = None
        """Message and payload of the latest frame with a time."""
        self._may_have_restarted = False
        """Whether there was a gap or a late frame since then, and the next time is awaited."""
        self._unconfirmed = 0
        """Change of the number of lost frames since this frame."""
        self._clock = VehicleClock()
        """Times since this frame."""

    def count(self, sequence: int, message_id: int | None = None, payload: bytes = b"") -> None:
        """Add the frames that are missing before a frame; subtract a late frame.

        Parameters
        ----------
        sequence : int
            Sequence number of the frame, modulo 256.
        message_id : int, optional
            Number of its message; None for a frame whose time is not used.
        payload : bytes
            Its payload.
        """
        ahead = 0 if self._expected is None else (sequence - self._expected) & 0xFF
        if ahead > 0xFF - MAX_FRAMES_LATE:
            self._add(-1 if sequence in self._missing else 0)
            self._missing.discard(sequence)
        else:
            self._expected = (sequence + 1) & 0xFF
            if ahead:
                self._add(ahead)
                self._missing |= {(sequence - n) & 0xFF for n in range(1, ahead + 1)}
            if self._missing:
                self._missing = {
                    n for n in self._missing if (sequence - n) & 0xFF < MAX_FRAMES_LATE
                }
        if message_id is None or time_reader(message_id) is None:
            return
        if self._may_have_restarted:
            self._confirm(sequence, _vehicle_time_us(message_id, payload))
        if not self._may_have_restarted:
            self._timed = message_id, payload

    def _add(self, lost: int) -> None:
        """Change the number of lost frames, unconfirmed until the time of the next is known."""
        if not self._may_have_restarted:
            self._clock = VehicleClock()
            latest_us = _vehicle_time_us(*self._timed) if self._timed else None
            if latest_us is not None:
                self._clock.read(latest_us)
        self._may_have_restarted = True
        self.lost += lost
        self._unconfirmed += lost

    def _confirm(self, sequence: int, time_us: int | None) -> None:
        """Take the change back if the clock has begun again; keep it if the clock goes on."""
        if time_us is None:
            return
        reading = self._clock.read(time_us)
        if reading.restarted:
            self.lost -= self._unconfirmed
            self._expected, self._missing = (sequence + 1) & 0xFF, set()
        if reading.valid:
            self._may_have_restarted, self._unconfirmed = False, 0


def _vehicle_time_us(message_id: int, payload: bytes) -> int | None:
    """Return the vehicle time of a message, in microseconds; None if it has none."""
    message, read = dialect.by_id(message_id), time_reader(message_id)
    return read(payload.ljust(message.struct.size, b"\0")) if message and read else None
