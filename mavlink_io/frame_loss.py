"""Count of the frames that a link has lost, by the gaps in the sequence numbers of each sender.

A sender that restarts counts its frames from 0 again; this gap is no loss. A restart is recognised
by vehicle time that begins again, some frames later.
"""

from mavlink_io import dialect
from mavlink_io.logging.ros1 import time_reader
from mavlink_io.vehicle_clock import VehicleClock


class FrameLoss:
    """Number of frames of one sender that did not arrive."""

    def __init__(self) -> None:
        self.lost = 0
        """Number of lost frames."""
        self._expected: int | None = None
        self._timed: tuple[int, bytes] | None = None
        """Message and payload of the latest frame with a time."""
        self._unconfirmed = 0
        """Number of lost frames since this frame, while the next time is awaited."""
        self._clock = VehicleClock()
        """Times since this frame, while there are unconfirmed frames."""

    def count(self, sequence: int, message_id: int | None = None, payload: bytes = b"") -> None:
        """Add the frames that are missing before a frame.

        Parameters
        ----------
        sequence : int
            Sequence number of the frame, modulo 256.
        message_id : int, optional
            Number of its message; None for a frame whose time is not used.
        payload : bytes
            Its payload.
        """
        gap = 0 if self._expected is None else (sequence - self._expected) & 0xFF
        self._expected = (sequence + 1) & 0xFF
        if gap:
            self._add(gap)
        if message_id is None or time_reader(message_id) is None:
            return
        if self._unconfirmed:
            self._confirm(_vehicle_time_us(message_id, payload))
        if not self._unconfirmed:
            self._timed = message_id, payload

    def _add(self, gap: int) -> None:
        """Add lost frames, unconfirmed until the time of the next frames is known."""
        if not self._unconfirmed:
            self._clock = VehicleClock()
            latest_us = _vehicle_time_us(*self._timed) if self._timed else None
            if latest_us is not None:
                self._clock.read(latest_us)
        self.lost += gap
        self._unconfirmed += gap

    def _confirm(self, time_us: int | None) -> None:
        """Take unconfirmed frames back if the clock has begun again; keep them if it goes on."""
        if time_us is None:
            return
        reading = self._clock.read(time_us)
        if reading.restarted:
            self.lost -= self._unconfirmed
        if reading.valid:
            self._unconfirmed = 0


def _vehicle_time_us(message_id: int, payload: bytes) -> int | None:
    """Return the vehicle time of a message, in microseconds; None if it has none."""
    message, read = dialect.by_id(message_id), time_reader(message_id)
    return read(payload.ljust(message.struct.size, b"\0")) if message and read else None
