"""The altimeter: range to the sea floor along one sonar beam, straight down in body axes."""

from __future__ import annotations

from math import cos, nan, radians
from typing import NamedTuple

from mavlink_io.jit import kernel
from sitl.core.environment.floor import SeaFloor
from sitl.core.sensors import echo
from sitl.core.sensors.datasheets import AltimeterSheet
from sitl.core.sensors.noise import NoiseStream, happens, normals, uniform
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, is_due, lose, row, timing
from sitl.core.sensors.true_motion import TrueMotion
from sitl.vehicle.vectors import Vector


class AltimeterSensor(NamedTuple):
    """Parameters of the altimeter."""

    timing: Timing = NOT_FITTED
    min_range_m: float = 0.0
    max_range_m: float = 0.0
    noise_m: float = 0.0
    outlier_chance: float = 0.0
    half_width_rad: float = 0.0
    """Half the beam width."""
    worst_tilt_cos: float = 0.0
    """Cosine of the largest tilt at which an echo returns."""


def build(sheet: AltimeterSheet, tick_us: int) -> AltimeterSensor:
    """Build the altimeter from its data sheet."""
    return AltimeterSensor(
        timing=timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us),
        min_range_m=sheet.min_range_m,
        max_range_m=sheet.max_range_m,
        noise_m=sheet.noise_m,
        outlier_chance=sheet.outlier_chance,
        half_width_rad=0.5 * radians(sheet.beam_width_deg),
        worst_tilt_cos=cos(radians(sheet.max_tilt_deg)),
    )


@kernel
def sample(
    sounder: AltimeterSensor,
    truth: TrueMotion,
    ground: SeaFloor,
    stream: NoiseStream,
    transit: Vector,
    latest: Vector,
) -> bool:
    """Sample if due; return whether ``latest``, the numbers of an ``Altimeter``, is new."""
    if is_due(sounder.timing, truth.time_us):
        reading = row(sounder.timing, transit, truth.time_us)
        _measure(sounder, truth, ground, stream, reading)
        lose(sounder.timing, reading, stream)
    return deliver(sounder.timing, transit, truth.time_us, latest)


@kernel
def _measure(
    sounder: AltimeterSensor,
    truth: TrueMotion,
    ground: SeaFloor,
    stream: NoiseStream,
    reading: Vector,
) -> None:
    """Write the measured range; the reading is lost without an echo.

    An outlier is an echo from an object between the vehicle and the floor, at a uniformly
    distributed range.
    """
    reading[0] = nan
    noise = normals(stream, 1)[0]
    if echo.tilt_cos(truth.attitude_q) < sounder.worst_tilt_cos:
        return
    range_m = echo.first_echo_m(
        ground, truth.position_ned_m, truth.attitude_q, sounder.half_width_rad
    )
    range_m += sounder.noise_m * noise
    if happens(stream, sounder.outlier_chance):
        farthest_m = max(sounder.min_range_m, min(range_m, sounder.max_range_m))
        range_m = uniform(stream, sounder.min_range_m, farthest_m)
    if sounder.min_range_m <= range_m <= sounder.max_range_m:
        reading[0] = truth.time_us
        reading[1] = range_m
        reading[2] = sounder.min_range_m
        reading[3] = sounder.max_range_m
