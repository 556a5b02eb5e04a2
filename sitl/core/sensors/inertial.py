"""Gyroscopes and accelerometers: white noise, turn-on bias, bias instability, scale, misalignment.

    measured = A true + b + n,   b = turn-on bias + wander

A: scale and misalignment. n: white noise. The wander (bias instability) is a first-order
Gauss-Markov process. Its Allan deviation has a maximum of 0.617 of its standard deviation at 1.89
time constants (IEEE Std 952-1997, annex C, exponentially correlated noise). The in-run bias
stability of a data sheet is measured as that maximum, which gives the standard deviation.
"""

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
"""Maximum of the Allan deviation of a Gauss-Markov process of unit variance."""
WANDER_PERIOD_US = 1_000_000
"""Time step of the wander, far below its time constant; it is constant in between."""

_PER_HOUR = 1.0 / 3600.0
_MICRO_G = 1e-6 * STANDARD_GRAVITY_MPS2


class Imu(NamedTuple):
    """Parameters of the IMU."""

    timing: Timing
    gyro_noise_radps: float
    accelerometer_noise_mps2: float
    """Standard deviation of the white noise of a sample."""
    gyro_wander_radps: float
    accelerometer_wander_mps2: float
    """Standard deviation of the wander."""
    wander_decay: float
    """Factor of the wander over its time step dt: exp(-dt / time constant)."""
    wander_noise_gain: float
    """Gain of the white noise that drives the wander: sqrt(1 - wander_decay^2)."""
    sheet: ImuSheet


class InertialReading(NamedTuple):
    """One reading, FRD axes."""

    specific_force_mps2: Vector = ZERO
    rates_radps: Vector = ZERO


class InertialErrors(NamedTuple):
    """Sensor errors of one run, FRD axes."""

    gyro_axes: Matrix
    accelerometer_axes: Matrix
    gyro_turn_on_radps: Vector
    accelerometer_turn_on_mps2: Vector
    gyro_bias_radps: Vector
    accelerometer_bias_mps2: Vector
    """Sum of turn-on bias and wander at present."""


class InertialState(NamedTuple):
    """Errors, latest reading, and readings in transit."""

    errors: InertialErrors = InertialErrors(
        gyro_axes=IDENTITY,
        accelerometer_axes=IDENTITY,
        gyro_turn_on_radps=ZERO,
        accelerometer_turn_on_mps2=ZERO,
        gyro_bias_radps=ZERO,
        accelerometer_bias_mps2=ZERO,
    )
    latest: InertialReading = InertialReading()
    """Latest reading that has arrived."""
    queue: Queue[InertialReading] = ()


def build(sheet: ImuSheet, tick_us: int) -> Imu:
    """Build the IMU from its data sheet."""
    # Bias wander b (rad/s, m/s2): a first-order Gauss-Markov process with time constant T (s) and
    # standard deviation sd, exact over its time step h (Gelb 1974, "Applied Optimal Estimation"):
    #     b <- a b + sd sqrt(1 - a^2) n,   a = e^(-h/T),   n standard normal.
    # The bias stability of the data sheet is the peak of the Allan deviation, ALLAN_PEAK sd.
    schedule = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    rate_hz = 1e6 / schedule.period_us
    decay = exp(-WANDER_PERIOD_US * 1e-6 / sheet.wander_time_s)
    return Imu(
        timing=schedule,
        gyro_noise_radps=white_noise_sd(radians(sheet.gyro_density_degps_rthz), rate_hz),
        accelerometer_noise_mps2=white_noise_sd(
            sheet.accelerometer_density_ug_rthz * _MICRO_G, rate_hz
        ),
        gyro_wander_radps=radians(sheet.gyro_stability_degph) * _PER_HOUR / ALLAN_PEAK,
        accelerometer_wander_mps2=sheet.accelerometer_stability_ug * _MICRO_G / ALLAN_PEAK,
        wander_decay=decay,
        wander_noise_gain=sqrt(1.0 - decay * decay),
        sheet=sheet,
    )


def initial_state(imu: Imu, stream: NoiseStream) -> InertialState:
    """Draw the errors of this run."""
    sheet = imu.sheet
    gyro = biases(radians(sheet.gyro_turn_on_degph) * _PER_HOUR, stream)
    accelerometer = biases(sheet.accelerometer_turn_on_ug * _MICRO_G, stream)
    scale, skew = 1e-6 * sheet.scale_ppm, radians(sheet.misalignment_deg)
    errors = InertialErrors(
        gyro_axes=imperfect_axes(scale, skew, stream),
        accelerometer_axes=imperfect_axes(scale, skew, stream),
        gyro_turn_on_radps=gyro,
        accelerometer_turn_on_mps2=accelerometer,
        gyro_bias_radps=_add(gyro, biases(imu.gyro_wander_radps, stream)),
        accelerometer_bias_mps2=_add(accelerometer, biases(imu.accelerometer_wander_mps2, stream)),
    )
    return InertialState(errors)


def sample(
    imu: Imu, truth: Truth, state: InertialState, stream: NoiseStream
) -> tuple[InertialState, bool]:
    """Sample if due; return the new state and whether ``latest`` is new in this tick."""
    errors, latest, queue = state
    time_us = truth.time_us
    if time_us % WANDER_PERIOD_US == 0:
        errors = _step_wander(imu, errors, stream)
    measured = _read(imu, truth, errors, stream) if is_due(imu.timing, time_us) else None
    queue, reading = queue_reading(imu.timing, queue, measured, time_us, stream)
    return InertialState(errors, reading or latest, queue), reading is not None


def _read(imu: Imu, truth: Truth, errors: InertialErrors, stream: NoiseStream) -> InertialReading:
    """Return a reading of the true motion with all errors."""
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
    """Advance the wander of all axes by one of its time steps."""
    n = stream.normals(6)
    gyro = imu.wander_noise_gain * imu.gyro_wander_radps
    force = imu.wander_noise_gain * imu.accelerometer_wander_mps2
    return errors._replace(
        gyro_bias_radps=_step_gauss_markov(
            errors.gyro_bias_radps, errors.gyro_turn_on_radps, imu.wander_decay, gyro, n[:3]
        ),
        accelerometer_bias_mps2=_step_gauss_markov(
            errors.accelerometer_bias_mps2,
            errors.accelerometer_turn_on_mps2,
            imu.wander_decay,
            force,
            n[3:],
        ),
    )


def _step_gauss_markov(
    bias: Vector, mean: Vector, decay: float, noise: float, draws: list[float]
) -> Vector:
    """Return mean + decay (bias - mean) + noise n for each axis."""
    x, y, z = (c + decay * (b - c) + noise * n for b, c, n in zip(bias, mean, draws, strict=True))
    return x, y, z


def _add(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
