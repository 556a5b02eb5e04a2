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
        self._clock = VehicleClock()
        self._unconfirmed = 0
        """Number of lost frames since the latest frame whose time continued the time before."""

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
        if self._expected is not None:
            gap = (sequence - self._expected) & 0xFF
            self.lost += gap
            self._unconfirmed += gap
        self._expected = (sequence + 1) & 0xFF
        time_us = None if message_id is None else _vehicle_time_us(message_id, payload)
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
