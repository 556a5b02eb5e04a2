"""Vehicle time of a sender: wraps of `time_boot_ms`, impossible single times, and restarts."""

from typing import NamedTuple

WRAP_US = 1000 * 2**32
"""Time after which `time_boot_ms` begins again at zero: 49.7 days."""
_WRAP_GATE_US = 3_600 * 10**6
"""Largest distance from the latest time at which a step counts as a wrap, not as a restart."""
MAX_LATE_US = 1_000_000
"""Largest time by which a sample of the same clock may be older than the latest one."""
MAX_AHEAD_US = 600 * 10**6
"""Largest time by which one sample alone may be later: telemetry pauses under water."""
RESTART_SAMPLES = 3
"""Number of samples in a row that agree on another time; fewer are impossible times."""


def unwrap_us(time_us: int, latest_us: int) -> int:
    """Return a time with the wraps of `time_boot_ms` since boot.

    Parameters
    ----------
    time_us : int
        Time in a message, in microseconds.
    latest_us : int
        Latest time of the same sender, with its wraps.

    Returns
    -------
    int
        The time within an hour of the latest one. If there is none, `time_us`: the vehicle has
        restarted.
    """
    unwrapped_us = time_us + WRAP_US * round((latest_us - time_us) / WRAP_US)
    return unwrapped_us if abs(unwrapped_us - latest_us) <= _WRAP_GATE_US else time_us


class ClockReading(NamedTuple):
    """Vehicle time of a sample."""

    time_us: int
    """Time with the wraps of `time_boot_ms`, in microseconds."""
    valid: bool
    """False for a time that contradicts the others; the sample is not to be used."""
    restarted: bool
    """Whether the clock has begun again: earlier samples are of another clock."""


class VehicleClock:
    """Latest time of a vehicle, without impossible times of single samples."""

    def __init__(self) -> None:
        self._latest_us: int | None = None
        self._other_us, self._others = 0, 0
        """Time of the last samples that contradict the latest time, and their number."""

    def read(self, time_us: int) -> ClockReading:
        """Return the vehicle time of the next sample.

        Parameters
        ----------
        time_us : int
            Time in the message, in microseconds.

        Returns
        -------
        ClockReading
            Time of the sample, and whether it is valid.
        """
        latest_us = self._latest_us
        if latest_us is None:
            self._latest_us = latest_us = time_us
        unwrapped_us = unwrap_us(time_us, latest_us)
        if _agrees(unwrapped_us, latest_us):
            self._others = 0
            self._latest_us = max(latest_us, unwrapped_us)
            return ClockReading(unwrapped_us, valid=True, restarted=False)
        self._others = self._others + 1 if _agrees(time_us, self._other_us) else 1
        self._other_us = time_us
        if self._others < RESTART_SAMPLES:
            return ClockReading(time_us, valid=False, restarted=False)
        self._latest_us, self._others = time_us, 0
        return ClockReading(time_us, valid=True, restarted=time_us < latest_us)


def _agrees(time_us: int, latest_us: int) -> bool:
    """Return whether a sample may follow one with the time `latest_us`."""
    return -MAX_LATE_US <= time_us - latest_us <= MAX_AHEAD_US
