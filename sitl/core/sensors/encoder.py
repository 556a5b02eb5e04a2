"""Encoders on both axes of the duct, as recommended in the paper ("Future work")."""

from __future__ import annotations

from math import radians
from typing import NamedTuple

from mavlink_io.jit import kernel
from sitl.core.sensors.datasheets import EncoderSheet
from sitl.core.sensors.noise import NoiseStream, normals
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, is_due, lose, row, timing
from sitl.core.sensors.true_motion import TrueMotion
from sitl.vehicle.vectors import Vector

STATE = 2
"""Length of the state: offsets of this run of rudder and elevator, rad."""


class Encoders(NamedTuple):
    """Parameters of the encoders."""

    timing: Timing = NOT_FITTED
    resolution_rad: float = 1.0
    noise_rad: float = 0.0
    offset_rad: float = 0.0
    """Standard deviation of the offset over runs."""
    travel_rad: float = 1.0
    """Duct angle of full control."""


def build(sheet: EncoderSheet, travel_deg: float, tick_us: int) -> Encoders:
    """Build the encoders from their data sheet."""
    resolution, noise, offset = (
        radians(d) for d in (sheet.resolution_deg, sheet.noise_deg, sheet.offset_deg)
    )
    schedule = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    return Encoders(
        timing=schedule,
        resolution_rad=resolution,
        noise_rad=noise,
        offset_rad=offset,
        travel_rad=radians(travel_deg),
    )


@kernel
def begin(encoders: Encoders, stream: NoiseStream, state: Vector) -> None:
    """Draw the offsets of this run."""
    draws = normals(stream, STATE)
    for axis in range(STATE):
        state[axis] = encoders.offset_rad * draws[axis]


@kernel
def sample(
    encoders: Encoders,
    truth: TrueMotion,
    state: Vector,
    stream: NoiseStream,
    transit: Vector,
    latest: Vector,
) -> bool:
    """Sample if due; return whether ``latest``, the numbers of a ``DuctFeedback``, is new."""
    if is_due(encoders.timing, truth.time_us):
        reading, n = row(encoders.timing, transit, truth.time_us), normals(stream, 2)
        reading[0] = truth.time_us
        reading[1] = _read(encoders, truth.rudder_rad + state[0] + encoders.noise_rad * n[0])
        reading[2] = _read(encoders, truth.elevator_rad + state[1] + encoders.noise_rad * n[1])
        lose(encoders.timing, reading, stream)
    return deliver(encoders.timing, transit, truth.time_us, latest)


@kernel
def _read(encoders: Encoders, angle_rad: float) -> float:
    """Round an angle to the resolution and return it as a fraction of the travel."""
    return (
        round(angle_rad / encoders.resolution_rad) * encoders.resolution_rad / encoders.travel_rad
    )
