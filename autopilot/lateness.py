"""Lateness of the tick: answers of sensor samples against the sensors' own clock.

The sample that was answered soonest after its time stamp, in a window of ten seconds, counts as on
time; the lateness of every other answer is its delay beyond that one. It contains waiting in the
operating system, garbage collection and the tick itself. It is not defined where vehicle time does
not follow the wall clock: in a simulation at another speed.
"""

from itertools import pairwise
from typing import NamedTuple

from autopilot.control.types import US_PER_S
from mavlink_io.clock import wall_s

WINDOW_S = 10.0
"""Wall time of one evaluation."""
MAX_WINDOW_US = int(2 * WINDOW_S * US_PER_S)
"""Vehicle time after which a window ends early. A simulation faster than real time would otherwise
keep more than a hundred thousand samples."""
MIN_SAMPLES = 20
"""Number of samples below which a window is not evaluated."""
MAX_RATE_ERROR = 0.02
"""Largest deviation of vehicle time per wall time from 1 of a vehicle in real time."""
MS_PER_S = 1e3


class Lateness(NamedTuple):
    """Lateness of the ticks of one window."""

    p50_ms: float
    p99_ms: float
    max_ms: float
    overruns: int
    """Ticks since the start of the program that were late by more than a sample interval."""
    new_overruns: int
    """Ticks of this window that were late by more than a sample interval."""
    interval_ms: float
    """Usual interval of the samples."""


class LatenessMeter:
    """Records the wall time of each answer, and evaluates a window when it is complete."""

    def __init__(self) -> None:
        self._walls_s: list[float] = []
        self._times_us: list[int] = []
        self._overruns = 0

    def record(self, time_us: int) -> Lateness | None:
        """Record that the sample of a vehicle time was answered now.

        Return the lateness at the end of a window in real time, else None.
        """
        now_s, walls_s, times_us = wall_s(), self._walls_s, self._times_us
        if walls_s and (
            now_s - walls_s[0] >= WINDOW_S
            or time_us - times_us[0] >= MAX_WINDOW_US
            or time_us <= times_us[-1]
        ):
            result = self._evaluate()
            self._walls_s, self._times_us = [now_s], [time_us]
            return result
        walls_s.append(now_s)
        times_us.append(time_us)
        return None

    def _evaluate(self) -> Lateness | None:
        """Return the lateness of the window; None for few samples or another speed."""
        walls_s, times_us = self._walls_s, self._times_us
        count = len(walls_s)
        elapsed_s = walls_s[-1] - walls_s[0]
        if count < MIN_SAMPLES or elapsed_s < 0.5 * WINDOW_S:
            return None
        vehicle_s = (times_us[-1] - times_us[0]) / US_PER_S
        if abs(vehicle_s / elapsed_s - 1.0) > MAX_RATE_ERROR:
            return None
        delays_s = [wall - us / US_PER_S for wall, us in zip(walls_s, times_us, strict=True)]
        soonest_s = min(delays_s)
        late_ms = sorted(MS_PER_S * (delay - soonest_s) for delay in delays_s)
        intervals_ms = sorted((after - before) / MS_PER_S for before, after in pairwise(times_us))
        interval_ms = intervals_ms[len(intervals_ms) // 2]
        new_overruns = sum(late > interval_ms for late in late_ms)
        self._overruns += new_overruns
        return Lateness(
            p50_ms=late_ms[count // 2],
            p99_ms=late_ms[min(count - 1, count * 99 // 100)],
            max_ms=late_ms[-1],
            overruns=self._overruns,
            new_overruns=new_overruns,
            interval_ms=interval_ms,
        )
