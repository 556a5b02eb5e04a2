"""The altimeter: range to the sea floor along one sonar beam, straight down in body axes."""

from __future__ import annotations

from math import cos, radians
from typing import NamedTuple

from mavlink_io.records import Altimeter
from sitl.core.environment import Environment
from sitl.core.sensors import echo
from sitl.core.sensors.datasheets import AltimeterSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth


class AltimeterSensor(NamedTuple):
    """Parameters of the altimeter."""

    timing: Timing
    sheet: AltimeterSheet
    half_width_rad: float
    """Half the beam width."""
    worst_tilt_cos: float
    """Cosine of the largest tilt at which an echo returns."""


AltimeterState = Queue[Altimeter]


def build(sheet: AltimeterSheet, tick_us: int) -> AltimeterSensor:
    """Build the altimeter from its data sheet."""
    schedule = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    return AltimeterSensor(
        timing=schedule,
        sheet=sheet,
        half_width_rad=0.5 * radians(sheet.beam_width_deg),
        worst_tilt_cos=cos(radians(sheet.max_tilt_deg)),
    )


def sample(
    sounder: AltimeterSensor,
    truth: Truth,
    sea: Environment,
    state: AltimeterState,
    stream: NoiseStream,
) -> tuple[AltimeterState, Altimeter | None]:
    """Sample if due; return the new state and the reading that arrives now, if any."""
    measured = (
        _measure(sounder, truth, sea, stream) if is_due(sounder.timing, truth.time_us) else None
    )
    return queue_reading(sounder.timing, state, measured, truth.time_us, stream)


def _measure(
    sounder: AltimeterSensor, truth: Truth, sea: Environment, stream: NoiseStream
) -> Altimeter | None:
    """Measure the range, or return None without an echo.

    An outlier is an echo from an object between the vehicle and the floor, at a uniformly
    distributed range.
    """
    sheet, noise = sounder.sheet, stream.normal()
    if echo.tilt_cos(truth.attitude_q) < sounder.worst_tilt_cos:
        return None
    range_m = echo.first_echo_m(
        sea.field.floor, truth.position_ned_m, truth.attitude_q, sounder.half_width_rad
    )
    range_m += sheet.noise_m * noise
    if stream.happens(sheet.outlier_chance):
        range_m = stream.uniform(sheet.min_range_m, min(range_m, sheet.max_range_m))
    if not sheet.min_range_m <= range_m <= sheet.max_range_m:
        return None
    return Altimeter(truth.time_us, range_m, sheet.min_range_m, sheet.max_range_m)
