"""When an instrument speaks: how often, how late, and how often not at all. All in whole ticks of
the simulator."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from sitl.core.sensors.noise import NoiseStream

Reading = TypeVar("Reading")
Queue = tuple[tuple[int, Reading], ...]
"""Readings on their way: each with the vehicle time (us) at which it arrives, in order."""


class Timing(NamedTuple):
    period_us: int
    latency_us: int
    """From the instant measured to the tick in which the reading arrives."""
    dropout: float
    """Probability that a reading never arrives."""


def timing(rate_hz: float, latency_s: float, dropout: float, tick_us: int) -> Timing:
    """Rate and latency rounded to whole ticks; nothing speaks more often than once a tick."""
    period = max(1, round(1e6 / (rate_hz * tick_us)))
    return Timing(period * tick_us, round(latency_s * 1e6 / tick_us) * tick_us, dropout)


def is_due(when: Timing, time_us: int) -> bool:
    """Whether the instrument takes a reading at ``time_us``."""
    return time_us % when.period_us == 0


def queue_reading(
    when: Timing, queue: Queue[Reading], taken: Reading | None, time_us: int, stream: NoiseStream
) -> tuple[Queue[Reading], Reading | None]:
    """Send off what was ``taken`` at ``time_us``; the readings still on their way, and the one that
    arrives now."""
    if taken is not None and stream.happens(when.dropout):
        taken = None
    if not when.latency_us:
        return queue, taken
    if taken is not None:
        queue = (*queue, (time_us + when.latency_us, taken))
    if queue and queue[0][0] <= time_us:
        return queue[1:], queue[0][1]
    return queue, None
