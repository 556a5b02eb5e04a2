"""The leak detector: two bare wires in the bilge."""

from __future__ import annotations

from mavlink_io.jit import kernel
from sitl.core.sensors.datasheets import Sheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Timing, deliver, is_due, lose, row, timing
from sitl.core.sensors.true_motion import TrueMotion
from sitl.vehicle.vectors import Vector


def build(sheet: Sheet, tick_us: int) -> Timing:
    """Build the detector from its data sheet."""
    return timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)


@kernel
def sample(
    detector: Timing, truth: TrueMotion, stream: NoiseStream, transit: Vector, latest: Vector
) -> bool:
    """Sample if due; return whether ``latest``, the numbers of a ``Leak``, is new."""
    if is_due(detector, truth.time_us):
        reading = row(detector, transit, truth.time_us)
        reading[0] = 1.0 if truth.flooding else 0.0
        lose(detector, reading, stream)
    return deliver(detector, transit, truth.time_us, latest)
