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

from math import cos, inf, nan, radians, sin, sqrt
from typing import NamedTuple

import numpy as np

from mavlink_io.frames import Quaternion, Vector, rotate, rotate_back
from mavlink_io.jit import entry_point, kernel, numeric
from sitl.core.environment.floor import SeaFloor
from sitl.core.sensors import echo
from sitl.core.sensors.datasheets import DvlSheet
from sitl.core.sensors.noise import NoiseStream, happens, normals, pick, uniform
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, is_due, lose, row, timing
from sitl.core.sensors.true_motion import TrueMotion
from sitl.vehicle.vectors import Vector as Array

_BEAMS = 4
_MIN_BEAMS = 3
_AZIMUTHS = tuple(radians(45.0 + 90.0 * k) for k in range(_BEAMS))
_SIGNS = (1.0, -1.0, 1.0, -1.0)
"""Signs of the beams in the residual."""


SCALE, MISALIGNMENT_RAD = 0, 1
"""Indices of the state, the errors of this run: scale factor of all velocities, from the error of
the sound speed; mounting error about the vertical axis."""
STATE = 2
"""Length of the state."""
_NO_BEAMS: tuple[Vector, ...] = ((0.0, 0.0, 1.0),) * _BEAMS


class DvlSensor(NamedTuple):
    """Parameters of the DVL."""

    timing: Timing = NOT_FITTED
    water_period_us: int = 1
    """Period of water-track readings."""
    min_altitude_m: float = 0.0
    max_altitude_m: float = 0.0
    noise_mps: float = 0.0
    """Standard deviation of a horizontal component of bottom track."""
    scale_error: float = 0.0
    misalignment_rad: float = 0.0
    """Standard deviations of scale error and misalignment over runs."""
    outlier_chance: float = 0.0
    outlier_mps: float = 0.0
    water_layer_m: float = 0.0
    """Far end of the layer used for water track, distance below the vehicle."""
    water_noise_mps: float = 0.0
    """Standard deviation of a horizontal component of water track."""
    beams: tuple[Vector, ...] = _NO_BEAMS
    """Unit vectors of the beams, FRD."""
    sine: float = 1.0
    cosine: float = 1.0
    """Sine and cosine of the beam angle."""
    worst_tilt_cos: float = 0.0
    """Cosine of the largest tilt for bottom track."""


def build(sheet: DvlSheet, tick_us: int) -> DvlSensor:
    """Build the DVL from its data sheet."""
    sine, cosine = sin(radians(sheet.beam_angle_deg)), cos(radians(sheet.beam_angle_deg))
    return DvlSensor(
        timing=timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us),
        water_period_us=timing(sheet.water_rate_hz, 0.0, 0.0, tick_us).period_us,
        min_altitude_m=sheet.min_altitude_m,
        max_altitude_m=sheet.max_altitude_m,
        noise_mps=sheet.noise_mps,
        scale_error=sheet.scale_error,
        misalignment_rad=radians(sheet.misalignment_deg),
        outlier_chance=sheet.outlier_chance,
        outlier_mps=sheet.outlier_mps,
        water_layer_m=sheet.water_layer_m,
        water_noise_mps=sheet.water_noise_mps,
        beams=tuple((sine * cos(azimuth), sine * sin(azimuth), cosine) for azimuth in _AZIMUTHS),
        sine=sine,
        cosine=cosine,
        worst_tilt_cos=cos(radians(sheet.max_tilt_deg)),
    )


@kernel
def begin(log: DvlSensor, stream: NoiseStream, state: Array) -> None:
    """Draw the errors of this run."""
    n = normals(stream, STATE)
    state[SCALE] = 1.0 + log.scale_error * n[0]
    state[MISALIGNMENT_RAD] = log.misalignment_rad * n[1]


@kernel
def sample(
    log: DvlSensor,
    truth: TrueMotion,
    ground: SeaFloor,
    state: Array,
    stream: NoiseStream,
    transit: Array,
    latest: Array,
) -> bool:
    """Sample if due; return whether ``latest``, the numbers of a ``Dvl``, is new."""
    if is_due(log.timing, truth.time_us):
        reading = row(log.timing, transit, truth.time_us)
        _measure(log, truth, ground, state, stream, reading)
        lose(log.timing, reading, stream)
    return deliver(log.timing, transit, truth.time_us, latest)


@kernel
def _measure(
    log: DvlSensor,
    truth: TrueMotion,
    ground: SeaFloor,
    state: Array,
    stream: NoiseStream,
    reading: Array,
) -> None:
    """Write bottom track if the floor is in range, else water track if due, else a lost reading."""
    reading[0] = nan
    scale, misalignment_rad = state[SCALE], state[MISALIGNMENT_RAD]
    observed = _observe(
        ground,
        log.beams,
        truth.position_ned_m,
        truth.attitude_q,
        truth.velocity_ned_mps,
        truth.water_velocity_ned_mps,
        (scale * cos(misalignment_rad), scale * sin(misalignment_rad), scale),
        log.cosine,
    )
    upright = echo.tilt_cos(truth.attitude_q) >= log.worst_tilt_cos
    echoes, missing, nearest_m = 0, _BEAMS, inf
    for i in range(_BEAMS):
        altitude_m = observed[0, i]
        nearest_m = min(nearest_m, altitude_m)
        if upright and log.min_altitude_m <= altitude_m <= log.max_altitude_m:
            echoes += 1
        elif missing == _BEAMS:
            missing = i
    if echoes >= _MIN_BEAMS:
        _add_noise(log, observed[1], log.noise_mps, stream)
        _solve(log, observed[1], missing, log.noise_mps, reading)
        reading[4] = 1.0
        reading[6] = round(100 * echoes / _BEAMS)
        reading[0] = truth.time_us
    elif truth.time_us % log.water_period_us == 0 and nearest_m >= log.water_layer_m:
        _add_noise(log, observed[2], log.water_noise_mps, stream)
        _solve(log, observed[2], _BEAMS, log.water_noise_mps, reading)
        reading[4] = 0.0
        reading[6] = 100.0
        reading[0] = truth.time_us


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


@kernel
def _solve(log: DvlSensor, along: Array, missing: int, noise_mps: float, reading: Array) -> None:
    """Write body velocity and figure of merit from the radial velocities (equations at the top).

    ``missing`` is the index of the beam without echo, `_BEAMS` for none. It takes the value for
    which the residual is zero.
    """
    # Equations: module docstring; a, b, c, d radial velocities (m/s). A beam without echo takes the
    # value for which a - b + c - d = 0. The figure of merit is the larger of noise and error
    # velocity, and sqrt(2) times the noise with three beams.
    if missing < _BEAMS:
        along[missing] = 0.0
        along[missing] = -_SIGNS[missing] * _residual(along)
    a, b, c, d = along[0], along[1], along[2], along[3]
    level, upright = 2.0 * sqrt(2.0) * log.sine, 4.0 * log.cosine
    reading[1] = (a - b - c + d) / level
    reading[2] = (a + b - c - d) / level
    reading[3] = (a + b + c + d) / upright
    error_mps = abs(_residual(along)) / level
    reading[5] = max(noise_mps, error_mps) if missing == _BEAMS else sqrt(2.0) * noise_mps


@kernel
def _residual(along: Array) -> float:
    """Return a - b + c - d, zero for one velocity: opposite beams then have equal sums."""
    return float(along[0] - along[1] + along[2] - along[3])


@numeric
def _instrument_axes(attitude_q: Quaternion, velocity_ned_mps: Vector, turn: Vector) -> Vector:
    """Rotate a velocity from NED to the DVL's axes and apply misalignment and scale error.

    ``turn`` contains cosine and sine of the misalignment, both times the scale, and the scale.
    """
    x, y, z = rotate_back(attitude_q, velocity_ned_mps)
    c, s, scale = turn
    return c * x + s * y, c * y - s * x, scale * z


@kernel
def _add_noise(log: DvlSensor, along: Array, noise_mps: float, stream: NoiseStream) -> None:
    """Add noise to radial velocities and, rarely, an outlier to one beam.

    ``noise_mps`` is the rms error of a horizontal component. The same noise in each beam gives it
    with the factor sqrt(2) sin B.
    """
    # along_i = beam_i . v + beam_noise n_i (m/s), with beam_i unit vector and v velocity in the
    # DVL's axes (FRD, misaligned), n_i standard normal.
    beam_noise = noise_mps * sqrt(2.0) * log.sine
    n = normals(stream, _BEAMS)
    for i in range(_BEAMS):
        along[i] += beam_noise * n[i]
    if happens(stream, log.outlier_chance):
        beam = pick(stream, _BEAMS)
        along[beam] += uniform(stream, -log.outlier_mps, log.outlier_mps)
