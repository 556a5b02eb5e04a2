"""Sample period, latency and dropout of sensors, in whole ticks of the simulator."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from sitl.core.sensors.noise import NoiseStream

Reading = TypeVar("Reading")
Queue = tuple[tuple[int, Reading], ...]
"""Readings in transit, in order: vehicle time of arrival (us) and reading."""


class Timing(NamedTuple):
    """Sample times of a sensor and arrival times of its readings."""

    period_us: int
    latency_us: int
    """Time from the measurement to the tick in which the reading arrives."""
    dropout: float
    """Probability that a reading is lost."""


def timing(rate_hz: float, latency_s: float, dropout: float, tick_us: int) -> Timing:
    """Round rate and latency to whole ticks; the shortest period is one tick."""
    period = max(1, round(1e6 / (rate_hz * tick_us)))
    return Timing(period * tick_us, round(latency_s * 1e6 / tick_us) * tick_us, dropout)


def is_due(schedule: Timing, time_us: int) -> bool:
    """Return whether the sensor takes a sample at ``time_us``."""
    return time_us % schedule.period_us == 0


def queue_reading(
    schedule: Timing,
    queue: Queue[Reading],
    measured: Reading | None,
    time_us: int,
    stream: NoiseStream,
) -> tuple[Queue[Reading], Reading | None]:
    """Queue the sample of ``time_us``, if any.

    Returns the readings still in transit, and the reading that arrives now, if any.
    """
    if measured is not None and stream.happens(schedule.dropout):
        measured = None
    if not schedule.latency_us:
        return queue, measured
    if measured is not None:
        queue = (*queue, (time_us + schedule.latency_us, measured))
    if queue and queue[0][0] <= time_us:
        return queue[1:], queue[0][1]
    return queue, None
