"""The Doppler velocity log (DVL): four beams in a Janus arrangement that measure radial velocity.

The beams are inclined by the beam angle from the body's down axis, at azimuths of 45, 135, 225 and
315 deg from the bow. With at least three echoes from the floor the DVL outputs velocity over ground
(bottom track), else velocity relative to a layer of water below it (water track). Four beams
measure three components, so there is a residual, the error velocity, from which the figure of merit
is computed (Brokloff 1994; RD Instruments, "ADCP coordinate transformation", 1998).

With radial velocities a, b, c, d, beam angle B and body velocity (u, v, w) in FRD:

    u = (a - b - c + d) / (2 sqrt(2) sin B)
    v = (a + b - c - d) / (2 sqrt(2) sin B)
    w = (a + b + c + d) / (4 cos B)
    error velocity = |a - b + c - d| / (2 sqrt(2) sin B)
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin, sqrt
from typing import NamedTuple

import numpy as np

from mavlink_io.frames import Quaternion, Vector, rotate, rotate_back
from mavlink_io.jit import entry_point, numeric
from mavlink_io.records import Dvl
from sitl.core.environment import Environment
from sitl.core.environment.floor import SeaFloor
from sitl.core.sensors import echo
from sitl.core.sensors.datasheets import DvlSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth
from sitl.vehicle.vectors import Vector as Array

_BEAMS = 4
_MIN_BEAMS = 3
_AZIMUTHS = tuple(radians(45.0 + 90.0 * k) for k in range(_BEAMS))
_SIGNS = (1.0, -1.0, 1.0, -1.0)
"""Signs of the beams in the residual."""


class DvlSensor(NamedTuple):
    """Parameters of the DVL."""

    timing: Timing
    water_period_us: int
    """Period of water-track readings."""
    sheet: DvlSheet
    beams: tuple[Vector, ...]
    """Unit vectors of the beams, FRD."""
    sine: float
    cosine: float
    """Sine and cosine of the beam angle."""
    worst_tilt_cos: float
    """Cosine of the largest tilt for bottom track."""


class DvlState(NamedTuple):
    """Errors of this run and readings in transit."""

    scale: float = 1.0
    """Scale factor of all velocities, from the error of the sound speed."""
    misalignment_rad: float = 0.0
    """Mounting error about the vertical axis."""
    queue: Queue[Dvl] = ()


def build(sheet: DvlSheet, tick_us: int) -> DvlSensor:
    """Build the DVL from its data sheet."""
    sine, cosine = sin(radians(sheet.beam_angle_deg)), cos(radians(sheet.beam_angle_deg))
    return DvlSensor(
        timing=timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us),
        water_period_us=timing(sheet.water_rate_hz, 0.0, 0.0, tick_us).period_us,
        sheet=sheet,
        beams=tuple((sine * cos(azimuth), sine * sin(azimuth), cosine) for azimuth in _AZIMUTHS),
        sine=sine,
        cosine=cosine,
        worst_tilt_cos=cos(radians(sheet.max_tilt_deg)),
    )


def initial_state(log: DvlSensor, stream: NoiseStream) -> DvlState:
    """Draw the errors of this run."""
    scale, turn = stream.normals(2)
    return DvlState(1.0 + log.sheet.scale_error * scale, radians(log.sheet.misalignment_deg) * turn)


def sample(
    log: DvlSensor, truth: Truth, sea: Environment, state: DvlState, stream: NoiseStream
) -> tuple[DvlState, Dvl | None]:
    """Sample if due; return the new state and the reading that arrives now, if any."""
    measured = (
        _measure(log, truth, sea, state, stream) if is_due(log.timing, truth.time_us) else None
    )
    queue, velocity = queue_reading(log.timing, state.queue, measured, truth.time_us, stream)
    return (state if queue is state.queue else state._replace(queue=queue)), velocity


def _measure(
    log: DvlSensor, truth: Truth, sea: Environment, state: DvlState, stream: NoiseStream
) -> Dvl | None:
    """Return bottom track if the floor is in range, else water track if due, else None."""
    sheet, misalignment_rad = log.sheet, state.misalignment_rad
    turn = state.scale * cos(misalignment_rad), state.scale * sin(misalignment_rad), state.scale
    altitudes_m, over_ground_mps, through_water_mps = _observe(
        sea.field.floor,
        log.beams,
        truth.position_ned_m,
        truth.attitude_q,
        truth.velocity_ned_mps,
        truth.water_velocity_ned_mps,
        turn,
        log.cosine,
    ).tolist()
    upright = echo.tilt_cos(truth.attitude_q) >= log.worst_tilt_cos
    echoes = [
        upright and sheet.min_altitude_m <= altitude <= sheet.max_altitude_m
        for altitude in altitudes_m
    ]
    if sum(echoes) >= _MIN_BEAMS:
        along = _add_noise(log, over_ground_mps, sheet.noise_mps, stream)
        return _solve(log, truth.time_us, along, echoes, True, sheet.noise_mps)
    if truth.time_us % log.water_period_us or min(altitudes_m) < sheet.water_layer_m:
        return None
    along = _add_noise(log, through_water_mps, sheet.water_noise_mps, stream)
    return _solve(log, truth.time_us, along, [True] * _BEAMS, False, sheet.water_noise_mps)


@entry_point
def _observe(
    ground: SeaFloor,
    beams: tuple[Vector, ...],
    position_ned_m: Vector,
    attitude_q: Quaternion,
    velocity_ned_mps: Vector,
    water_velocity_ned_mps: Vector,
    turn: Vector,
    cosine: float,
) -> Array:
    """Return what the beams observe without noise, shape (3, beams).

    Rows: altitude (m), radial velocity over ground and through the water (m/s). ``turn`` is as in
    ``_instrument_axes``.
    """
    observed = np.empty((3, len(beams)))
    (vn, ve, vd), (wn, we, wd) = velocity_ned_mps, water_velocity_ned_mps
    x, y, z = _instrument_axes(attitude_q, velocity_ned_mps, turn)
    wx, wy, wz = _instrument_axes(attitude_q, (vn - wn, ve - we, vd - wd), turn)
    for i in range(len(beams)):
        bx, by, bz = beams[i]
        observed[0, i] = cosine * echo.range_m(ground, position_ned_m, rotate(attitude_q, beams[i]))
        observed[1, i] = x * bx + y * by + z * bz
        observed[2, i] = wx * bx + wy * by + wz * bz
    return observed


def _solve(
    log: DvlSensor,
    time_us: int,
    along: list[float],
    echoes: Sequence[bool],
    over_ground: bool,
    noise_mps: float,
) -> Dvl:
    """Compute the body velocity from the radial velocities (equations at the top).

    A missing beam is replaced by the value for which the residual is zero.
    """
    # Equations: module docstring; a, b, c, d radial velocities (m/s). A beam without echo takes the
    # value for which a - b + c - d = 0. The figure of merit is the larger of noise and error
    # velocity, and sqrt(2) times the noise with three beams.
    if False in echoes:
        missing = echoes.index(False)
        along[missing] = 0.0
        along[missing] = -_SIGNS[missing] * _residual(*along)
    a, b, c, d = along
    level, upright = 2.0 * sqrt(2.0) * log.sine, 4.0 * log.cosine
    error_mps = abs(_residual(a, b, c, d)) / level
    merit = max(noise_mps, error_mps) if all(echoes) else sqrt(2.0) * noise_mps
    return Dvl(
        time_us,
        (a - b - c + d) / level,
        (a + b - c - d) / level,
        (a + b + c + d) / upright,
        over_ground,
        merit,
        round(100 * sum(echoes) / _BEAMS),
    )


def _residual(a: float, b: float, c: float, d: float) -> float:
    """Return a - b + c - d, zero for one velocity: opposite beams then have equal sums."""
    return a - b + c - d


@numeric
def _instrument_axes(attitude_q: Quaternion, velocity_ned_mps: Vector, turn: Vector) -> Vector:
    """Rotate a velocity from NED to the DVL's axes and apply misalignment and scale error.

    ``turn`` contains cosine and sine of the misalignment, both times the scale, and the scale.
    """
    x, y, z = rotate_back(attitude_q, velocity_ned_mps)
    c, s, scale = turn
    return c * x + s * y, c * y - s * x, scale * z


def _add_noise(
    log: DvlSensor, radial_mps: Sequence[float], noise_mps: float, stream: NoiseStream
) -> list[float]:
    """Return radial velocities with noise and, rarely, an outlier in one beam.

    ``noise_mps`` is the rms error of a horizontal component. The same noise in each beam gives it
    with the factor sqrt(2) sin B.
    """
    # along_i = beam_i . v + beam_noise n_i (m/s), with beam_i unit vector and v velocity in the
    # DVL's axes (FRD, misaligned), n_i standard normal.
    sheet, beam_noise = log.sheet, noise_mps * sqrt(2.0) * log.sine
    draws = stream.normals(_BEAMS)
    along = [radial + beam_noise * n for radial, n in zip(radial_mps, draws, strict=True)]
    if stream.happens(sheet.outlier_chance):
        along[stream.pick(_BEAMS)] += stream.uniform(-sheet.outlier_mps, sheet.outlier_mps)
    return along
