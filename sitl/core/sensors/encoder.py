"""Encoders on the duct's two axes: where it really stands, which the paper wished for ("Future
work")."""

from __future__ import annotations

from math import radians
from typing import NamedTuple

from mavlink_io.records import DuctFeedback
from sitl.core.sensors.datasheets import EncoderSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth


class Encoders(NamedTuple):
    timing: Timing
    resolution_rad: float
    noise_rad: float
    offset_rad: float
    """One standard deviation over runs."""
    travel_rad: float


class EncoderState(NamedTuple):
    rudder_offset_rad: float = 0.0
    elevator_offset_rad: float = 0.0
    queue: Queue[DuctFeedback] = ()


def build(sheet: EncoderSheet, travel_deg: float, tick_us: int) -> Encoders:
    resolution, noise, offset = (
        radians(d) for d in (sheet.resolution_deg, sheet.noise_deg, sheet.offset_deg)
    )
    when = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    return Encoders(when, resolution, noise, offset, radians(travel_deg))


def initial_state(encoders: Encoders, stream: NoiseStream) -> EncoderState:
    """The zero errors of this run."""
    rudder, elevator = (encoders.offset_rad * n for n in stream.normals(2))
    return EncoderState(rudder, elevator)


def sample(
    encoders: Encoders, truth: Truth, memory: EncoderState, stream: NoiseStream
) -> tuple[EncoderState, DuctFeedback | None]:
    """The angles that arrive now, if they do."""
    taken = None
    if is_due(encoders.timing, truth.time_us):
        n_rudder, n_elevator = stream.normals(2)
        rudder = _read(
            encoders, truth.rudder_rad + memory.rudder_offset_rad + encoders.noise_rad * n_rudder
        )
        elevator = _read(
            encoders,
            truth.elevator_rad + memory.elevator_offset_rad + encoders.noise_rad * n_elevator,
        )
        taken = DuctFeedback(truth.time_us, rudder, elevator)
    queue, feedback = queue_reading(encoders.timing, memory.queue, taken, truth.time_us, stream)
    return (memory if queue is memory.queue else memory._replace(queue=queue)), feedback


def _read(encoders: Encoders, angle_rad: float) -> float:
    """The nearest whole step, as a fraction of the travel."""
    return (
        round(angle_rad / encoders.resolution_rad) * encoders.resolution_rad / encoders.travel_rad
    )
