"""The leak detector: two bare wires in the bilge."""

from __future__ import annotations

from mavlink_io.records import Leak
from sitl.core.sensors.datasheets import Sheet
from sitl.core.sensors.noise import Draws
from sitl.core.sensors.sample_timing import Queue, Timing, arrive, due, timing
from sitl.core.truth import Truth

Memory = Queue[Leak]


def build(sheet: Sheet, tick_us: int) -> Timing:
    return timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)


def sample(
    detector: Timing, truth: Truth, memory: Memory, stream: Draws
) -> tuple[Memory, Leak | None]:
    """What arrives now, if anything does."""
    taken = Leak(truth.flooding) if due(detector, truth.time_us) else None
    return arrive(detector, memory, taken, truth.time_us, stream)
