"""The Doppler velocity log: four beams in Janus arrangement, each measuring the speed along itself.

Beams lean by the beam angle from the body's down, 45 deg off the bow. With three echoes or more off
the floor the log tracks the bottom: velocity over ground. With fewer it tracks the water some
metres below: velocity through the water. Four beams measure three components, so they can disagree:
the error velocity (Brokloff 1994; RD Instruments, "ADCP coordinate transformation", 1998). From
that comes the figure of merit."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin, sqrt
from typing import NamedTuple

from mavlink_io.frames import Vector, rotate_back
from mavlink_io.records import Dvl
from sitl.core.environment import Environment
from sitl.core.sensors import echo
from sitl.core.sensors.datasheets import DvlSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth

_BEAMS = 4
_MIN_BEAMS = 3
_AZIMUTHS = tuple(radians(45.0 + 90.0 * k) for k in range(_BEAMS))
_SIGNS = (1.0, -1.0, 1.0, -1.0)
"""Of the beams in their disagreement."""


class DvlSensor(NamedTuple):
    timing: Timing
    water_period_us: int
    sheet: DvlSheet
    beams: tuple[Vector, ...]
    """Unit vectors, FRD."""
    sine: float
    cosine: float
    """Of the beam angle."""
    worst_tilt_cos: float


class DvlState(NamedTuple):
    scale: float = 1.0
    """Of all velocities: the error of the speed of sound."""
    misalignment_rad: float = 0.0
    """About the vertical axis."""
    queue: Queue[Dvl] = ()


def build(sheet: DvlSheet, tick_us: int) -> DvlSensor:
    sine, cosine = sin(radians(sheet.beam_angle_deg)), cos(radians(sheet.beam_angle_deg))
    return DvlSensor(
        timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us),
        timing(sheet.water_rate_hz, 0.0, 0.0, tick_us).period_us,
        sheet,
        tuple((sine * cos(azimuth), sine * sin(azimuth), cosine) for azimuth in _AZIMUTHS),
        sine,
        cosine,
        cos(radians(sheet.max_tilt_deg)),
    )


def initial_state(log: DvlSensor, stream: NoiseStream) -> DvlState:
    """The errors that this run's instrument has."""
    scale, turn = stream.normals(2)
    return DvlState(1.0 + log.sheet.scale_error * scale, radians(log.sheet.misalignment_deg) * turn)


def sample(
    log: DvlSensor, truth: Truth, sea: Environment, memory: DvlState, stream: NoiseStream
) -> tuple[DvlState, Dvl | None]:
    """The velocity that arrives now, if one does."""
    taken = _measure(log, truth, sea, memory, stream) if is_due(log.timing, truth.time_us) else None
    queue, velocity = queue_reading(log.timing, memory.queue, taken, truth.time_us, stream)
    return (memory if queue is memory.queue else memory._replace(queue=queue)), velocity


def _measure(
    log: DvlSensor, truth: Truth, sea: Environment, memory: DvlState, stream: NoiseStream
) -> Dvl | None:
    """Bottom track where there is bottom, else water track where there is water, else None."""
    sheet = log.sheet
    altitudes_m = [
        log.cosine * echo.range_m(sea, truth.position_ned_m, truth.attitude_q, beam)
        for beam in log.beams
    ]
    upright = echo.tilt_cos(truth.attitude_q) >= log.worst_tilt_cos
    echoes = [
        upright and sheet.min_altitude_m <= altitude <= sheet.max_altitude_m
        for altitude in altitudes_m
    ]
    if sum(echoes) >= _MIN_BEAMS:
        return _solve(
            log, truth, truth.velocity_ned_mps, echoes, True, sheet.noise_mps, memory, stream
        )
    if truth.time_us % log.water_period_us or min(altitudes_m) < sheet.water_layer_m:
        return None
    (vn, ve, vd), (wn, we, wd) = truth.velocity_ned_mps, truth.water_velocity_ned_mps
    through_water, everywhere = (vn - wn, ve - we, vd - wd), [True] * _BEAMS
    return _solve(
        log, truth, through_water, everywhere, False, sheet.water_noise_mps, memory, stream
    )


def _solve(
    log: DvlSensor,
    truth: Truth,
    velocity_ned_mps: Vector,
    echoes: Sequence[bool],
    over_ground: bool,
    noise_mps: float,
    memory: DvlState,
    stream: NoiseStream,
) -> Dvl:
    """Velocity in body axes from what the beams measure; one that has no echo is made up from the
    three others."""
    along = _along_beams(log, _instrument_axes(truth, velocity_ned_mps, memory), noise_mps, stream)
    if False in echoes:
        silent = echoes.index(False)
        along[silent] = 0.0
        along[silent] = -_SIGNS[silent] * _disagreement(*along)
    a, b, c, d = along
    level, upright = 2.0 * sqrt(2.0) * log.sine, 4.0 * log.cosine
    error_mps = abs(_disagreement(a, b, c, d)) / level
    merit = max(noise_mps, error_mps) if all(echoes) else sqrt(2.0) * noise_mps
    return Dvl(
        truth.time_us,
        (a - b - c + d) / level,
        (a + b - c - d) / level,
        (a + b + c + d) / upright,
        over_ground,
        merit,
        round(100 * sum(echoes) / _BEAMS),
    )


def _disagreement(a: float, b: float, c: float, d: float) -> float:
    """Zero of four beams that move with one velocity: opposite beams then add up to the same."""
    return a - b + c - d


def _instrument_axes(truth: Truth, velocity_ned_mps: Vector, memory: DvlState) -> Vector:
    """The velocity as a perfect set of beams would have it, mounted askew and scaled by the wrong
    speed of sound."""
    x, y, z = rotate_back(truth.attitude_q, velocity_ned_mps)
    c, s = memory.scale * cos(memory.misalignment_rad), memory.scale * sin(memory.misalignment_rad)
    return c * x + s * y, c * y - s * x, memory.scale * z


def _along_beams(
    log: DvlSensor, velocity: Vector, noise_mps: float, stream: NoiseStream
) -> list[float]:
    """Speed along each beam. ``noise_mps`` is that of the horizontal components; an outlier is a
    beam gone astray."""
    sheet, beam_noise = log.sheet, noise_mps * sqrt(2.0) * log.sine
    x, y, z = velocity
    draws = stream.normals(_BEAMS)
    along = [
        x * bx + y * by + z * bz + beam_noise * n
        for (bx, by, bz), n in zip(log.beams, draws, strict=True)
    ]
    if stream.happens(sheet.outlier_chance):
        along[stream.pick(_BEAMS)] += stream.uniform(-sheet.outlier_mps, sheet.outlier_mps)
    return along
