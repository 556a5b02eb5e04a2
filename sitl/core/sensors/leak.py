"""The leak detector: two bare wires in the bilge."""

from __future__ import annotations

from mavlink_io.records import Leak
from sitl.core.sensors.datasheets import Sheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth

LeakState = Queue[Leak]


def build(sheet: Sheet, tick_us: int) -> Timing:
    """Build the detector from its data sheet."""
    return timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)


def sample(
    detector: Timing, truth: Truth, state: LeakState, stream: NoiseStream
) -> tuple[LeakState, Leak | None]:
    """Sample if due; return the new state and the reading that arrives now, if any."""
    measured = Leak(truth.flooding) if is_due(detector, truth.time_us) else None
    return queue_reading(detector, state, measured, truth.time_us, stream)
