"""Sample period, latency and dropout of sensors, in whole ticks of the simulator.

Readings in transit are rows of an array. The first number of a lost reading is NaN.
"""

from __future__ import annotations

from math import erfc, isnan, nan, sqrt
from typing import NamedTuple

from mavlink_io.jit import kernel, numeric
from sitl.core.draws import DrawTable, draw
from sitl.core.sensors.noise import NoiseStream, happens
from sitl.vehicle.vectors import Vector


class Timing(NamedTuple):
    """Sample times of a sensor and arrival times of its readings."""

    period_us: int
    """0 for a sensor that is not fitted."""
    latency_us: int
    """Time from the measurement to the tick in which the reading arrives."""
    dropout: float
    """Probability that a reading is lost."""


NOT_FITTED = Timing(0, 0, 0.0)
"""Timing of a sensor that is not fitted."""


def timing(rate_hz: float, latency_s: float, dropout: float, tick_us: int) -> Timing:
    """Round rate and latency to whole ticks; the shortest period is one tick."""
    period = max(1, round(1e6 / (rate_hz * tick_us)))
    return Timing(period * tick_us, round(latency_s * 1e6 / tick_us) * tick_us, dropout)


@numeric
def is_due(schedule: Timing, time_us: int) -> bool:
    """Return whether the sensor takes a sample at ``time_us``."""
    return schedule.period_us > 0 and time_us % schedule.period_us == 0


def slots(schedule: Timing) -> int:
    """Return the number of rows for readings in transit."""
    return schedule.latency_us // schedule.period_us + 1 if schedule.period_us else 1


@kernel
def row(schedule: Timing, transit: Vector, time_us: int) -> Vector:
    """Return the row of the reading measured at ``time_us``, one of its sample times."""
    reading: Vector = transit[time_us // schedule.period_us % len(transit)]
    return reading


@kernel
def drop(schedule: Timing, reading: Vector, table: DrawTable, stream: int) -> None:
    """Mark a reading as lost, with the probability of a dropout; for zero nothing is drawn."""
    # P(n < x) = erfc(-x / sqrt 2) / 2 is uniform on [0, 1] for a standard normal draw n.
    if schedule.dropout > 0.0:
        uniform = 0.5 * erfc(-draw(table, stream) / sqrt(2.0))
        if uniform < schedule.dropout:
            reading[0] = nan


@kernel
def lose(schedule: Timing, reading: Vector, stream: NoiseStream) -> None:
    """Mark a reading of a slower sensor as lost, with the probability of a dropout."""
    if not isnan(reading[0]) and happens(stream, schedule.dropout):
        reading[0] = nan


@kernel
def deliver(schedule: Timing, transit: Vector, time_us: int, latest: Vector) -> bool:
    """Copy the reading that arrives at ``time_us`` to ``latest``; return whether one does."""
    measured_us = time_us - schedule.latency_us
    if measured_us < 0 or not is_due(schedule, measured_us):
        return False
    reading = row(schedule, transit, measured_us)
    if isnan(reading[0]):
        return False
    for i in range(len(reading)):
        latest[i] = reading[i]
    return True
