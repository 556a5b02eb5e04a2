"""Gyros and accelerometers: white noise, a bias that differs from run to run and wanders within
one, imperfect axes.

The wander (bias instability) is a first-order Gauss-Markov process. Its Allan deviation peaks at
0.617 of its standard deviation, 1.89 time constants away (IEEE Std 952-1997, annex C, exponentially
correlated noise); a data sheet's in-run bias stability is taken as that peak, so the standard
deviation follows from it."""

from __future__ import annotations

from math import exp, radians, sqrt
from typing import NamedTuple

from mavlink_io.frames import STANDARD_GRAVITY_MPS2, Vector
from sitl.core.sensors.datasheets import ImuSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.sensors.three_axis import (
    IDENTITY,
    ZERO,
    Matrix,
    apply_errors,
    biases,
    imperfect_axes,
    white_noise_sd,
)
from sitl.core.truth import Truth

ALLAN_PEAK = 0.617
"""Of a Gauss-Markov process of unit variance."""
WANDER_PERIOD_US = 1_000_000
"""The wander moves in steps of a second: far below its time constant, and it costs nothing in
between."""

_PER_HOUR = 1.0 / 3600.0
_MICRO_G = 1e-6 * STANDARD_GRAVITY_MPS2


class Imu(NamedTuple):
    timing: Timing
    gyro_noise_radps: float
    accelerometer_noise_mps2: float
    gyro_wander_radps: float
    accelerometer_wander_mps2: float
    """One standard deviation of each wander."""
    keep: float
    """Of the wander over one of its steps."""
    renew: float
    sheet: ImuSheet


class InertialReading(NamedTuple):
    """One reading, FRD axes."""

    specific_force_mps2: Vector = ZERO
    rates_radps: Vector = ZERO


class InertialErrors(NamedTuple):
    gyro_axes: Matrix
    accelerometer_axes: Matrix
    gyro_turn_on_radps: Vector
    accelerometer_turn_on_mps2: Vector
    gyro_bias_radps: Vector
    accelerometer_bias_mps2: Vector
    """Turn-on bias and wander together, as they stand."""


class InertialState(NamedTuple):
    errors: InertialErrors = InertialErrors(IDENTITY, IDENTITY, ZERO, ZERO, ZERO, ZERO)
    held: InertialReading = InertialReading()
    """The newest reading that arrived."""
    queue: Queue[InertialReading] = ()


def build(sheet: ImuSheet, tick_us: int) -> Imu:
    when = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    rate_hz = 1e6 / when.period_us
    keep = exp(-WANDER_PERIOD_US * 1e-6 / sheet.wander_time_s)
    return Imu(
        when,
        white_noise_sd(radians(sheet.gyro_density_degps_rthz), rate_hz),
        white_noise_sd(sheet.accelerometer_density_ug_rthz * _MICRO_G, rate_hz),
        radians(sheet.gyro_stability_degph) * _PER_HOUR / ALLAN_PEAK,
        sheet.accelerometer_stability_ug * _MICRO_G / ALLAN_PEAK,
        keep,
        sqrt(1.0 - keep * keep),
        sheet,
    )


def initial_state(imu: Imu, stream: NoiseStream) -> InertialState:
    """The errors that this run's instrument has."""
    sheet = imu.sheet
    gyro = biases(radians(sheet.gyro_turn_on_degph) * _PER_HOUR, stream)
    accelerometer = biases(sheet.accelerometer_turn_on_ug * _MICRO_G, stream)
    scale, skew = 1e-6 * sheet.scale_ppm, radians(sheet.misalignment_deg)
    errors = InertialErrors(
        imperfect_axes(scale, skew, stream),
        imperfect_axes(scale, skew, stream),
        gyro,
        accelerometer,
        _add(gyro, biases(imu.gyro_wander_radps, stream)),
        _add(accelerometer, biases(imu.accelerometer_wander_mps2, stream)),
    )
    return InertialState(errors)


def sample(
    imu: Imu, truth: Truth, memory: InertialState, stream: NoiseStream
) -> tuple[InertialState, bool]:
    """``memory.held`` is what the instrument reads; True when it is new."""
    errors, held, queue = memory
    time_us = truth.time_us
    if time_us % WANDER_PERIOD_US == 0:
        errors = _step_wander(imu, errors, stream)
    taken = _read(imu, truth, errors, stream) if is_due(imu.timing, time_us) else None
    queue, reading = queue_reading(imu.timing, queue, taken, time_us, stream)
    return InertialState(errors, reading or held, queue), reading is not None


def _read(imu: Imu, truth: Truth, errors: InertialErrors, stream: NoiseStream) -> InertialReading:
    a, b, c, d, e, f = stream.normals(6)
    force = apply_errors(
        truth.specific_force_mps2,
        errors.accelerometer_axes,
        errors.accelerometer_bias_mps2,
        imu.accelerometer_noise_mps2,
        a,
        b,
        c,
    )
    rates = apply_errors(
        truth.rates_radps, errors.gyro_axes, errors.gyro_bias_radps, imu.gyro_noise_radps, d, e, f
    )
    return InertialReading(force, rates)


def _step_wander(imu: Imu, errors: InertialErrors, stream: NoiseStream) -> InertialErrors:
    n = stream.normals(6)
    gyro, force = imu.renew * imu.gyro_wander_radps, imu.renew * imu.accelerometer_wander_mps2
    return errors._replace(
        gyro_bias_radps=_step_gauss_markov(
            errors.gyro_bias_radps, errors.gyro_turn_on_radps, imu.keep, gyro, n[:3]
        ),
        accelerometer_bias_mps2=_step_gauss_markov(
            errors.accelerometer_bias_mps2,
            errors.accelerometer_turn_on_mps2,
            imu.keep,
            force,
            n[3:],
        ),
    )


def _step_gauss_markov(
    bias: Vector, centre: Vector, keep: float, renew: float, draws: list[float]
) -> Vector:
    x, y, z = (c + keep * (b - c) + renew * n for b, c, n in zip(bias, centre, draws, strict=True))
    return x, y, z


def _add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
