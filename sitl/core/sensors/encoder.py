"""Encoders on both axes of the duct, as recommended in the paper ("Future work")."""

from __future__ import annotations

from math import radians
from typing import NamedTuple

from mavlink_io.records import DuctFeedback
from sitl.core.sensors.datasheets import EncoderSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth


class Encoders(NamedTuple):
    """Parameters of the encoders."""

    timing: Timing
    resolution_rad: float
    noise_rad: float
    offset_rad: float
    """Standard deviation of the offset over runs."""
    travel_rad: float
    """Duct angle of full control."""


class EncoderState(NamedTuple):
    """Offsets of this run and readings in transit."""

    rudder_offset_rad: float = 0.0
    elevator_offset_rad: float = 0.0
    queue: Queue[DuctFeedback] = ()


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


def initial_state(encoders: Encoders, stream: NoiseStream) -> EncoderState:
    """Draw the offsets of this run."""
    rudder, elevator = (encoders.offset_rad * n for n in stream.normals(2))
    return EncoderState(rudder, elevator)


def sample(
    encoders: Encoders, truth: Truth, state: EncoderState, stream: NoiseStream
) -> tuple[EncoderState, DuctFeedback | None]:
    """Sample if due; return the new state and the reading that arrives now, if any."""
    measured = None
    if is_due(encoders.timing, truth.time_us):
        n_rudder, n_elevator = stream.normals(2)
        rudder = _read(
            encoders, truth.rudder_rad + state.rudder_offset_rad + encoders.noise_rad * n_rudder
        )
        elevator = _read(
            encoders,
            truth.elevator_rad + state.elevator_offset_rad + encoders.noise_rad * n_elevator,
        )
        measured = DuctFeedback(truth.time_us, rudder, elevator)
    queue, feedback = queue_reading(encoders.timing, state.queue, measured, truth.time_us, stream)
    return (state if queue is state.queue else state._replace(queue=queue)), feedback


def _read(encoders: Encoders, angle_rad: float) -> float:
    """Round an angle to the resolution and return it as a fraction of the travel."""
    return (
        round(angle_rad / encoders.resolution_rad) * encoders.resolution_rad / encoders.travel_rad
    )
