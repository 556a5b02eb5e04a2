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

from mavlink_io.frames import STANDARD_GRAVITY_MPS2
from mavlink_io.frames import Vector as Vector3
from mavlink_io.jit import kernel
from sitl.core import draws
from sitl.core.draws import Draws, DrawTable, draw
from sitl.core.sensors.datasheets import ImuSheet
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, drop, is_due, row, timing
from sitl.core.sensors.three_axis import (
    IDENTITY,
    ZERO,
    Matrix,
    apply_errors,
    biases,
    imperfect_axes,
    white_noise_sd,
)
from sitl.vehicle.vectors import Vector

ALLAN_PEAK = 0.617
"""Maximum of the Allan deviation of a Gauss-Markov process of unit variance."""
WANDER_PERIOD_US = 1_000_000
"""Time step of the wander, far below its time constant; it is constant in between."""
READING = 6
"""Length of a reading: specific force (m/s2) and angular rate (rad/s), each x, y, z in FRD."""

_PER_HOUR = 1.0 / 3600.0
_MICRO_G = 1e-6 * STANDARD_GRAVITY_MPS2


class Imu(NamedTuple):
    """Parameters of the IMU."""

    timing: Timing = NOT_FITTED
    gyro_noise_radps: float = 0.0
    accelerometer_noise_mps2: float = 0.0
    """Standard deviation of the white noise of a sample."""
    gyro_wander_radps: float = 0.0
    accelerometer_wander_mps2: float = 0.0
    """Standard deviation of the wander."""
    wander_decay: float = 0.0
    """Factor of the wander over its time step dt: exp(-dt / time constant)."""
    wander_noise_gain: float = 0.0
    """Gain of the white noise that drives the wander: sqrt(1 - wander_decay^2)."""
    gyro_turn_on_radps: float = 0.0
    accelerometer_turn_on_mps2: float = 0.0
    """Standard deviation of the turn-on bias over runs."""
    scale: float = 0.0
    skew_rad: float = 0.0
    """Standard deviations of scale errors and misalignments over runs."""


class InertialErrors(NamedTuple):
    """Errors that are constant during a run, FRD axes."""

    gyro_axes: Matrix = IDENTITY
    accelerometer_axes: Matrix = IDENTITY
    gyro_turn_on_radps: Vector3 = ZERO
    accelerometer_turn_on_mps2: Vector3 = ZERO


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
        gyro_turn_on_radps=radians(sheet.gyro_turn_on_degph) * _PER_HOUR,
        accelerometer_turn_on_mps2=sheet.accelerometer_turn_on_ug * _MICRO_G,
        scale=1e-6 * sheet.scale_ppm,
        skew_rad=radians(sheet.misalignment_deg),
    )


def initial_errors(imu: Imu, stream: Draws) -> tuple[InertialErrors, tuple[float, ...]]:
    """Draw the errors of this run.

    Returns the constant errors, and the biases at vehicle time zero as in ``sample``.
    """
    gyro = biases(imu.gyro_turn_on_radps, stream, draws.IMU)
    force = biases(imu.accelerometer_turn_on_mps2, stream, draws.IMU)
    errors = InertialErrors(
        gyro_axes=imperfect_axes(imu.scale, imu.skew_rad, stream, draws.IMU),
        accelerometer_axes=imperfect_axes(imu.scale, imu.skew_rad, stream, draws.IMU),
        gyro_turn_on_radps=gyro,
        accelerometer_turn_on_mps2=force,
    )
    gyro_wander = biases(imu.gyro_wander_radps, stream, draws.IMU)
    force_wander = biases(imu.accelerometer_wander_mps2, stream, draws.IMU)
    return errors, (*_add(gyro, gyro_wander), *_add(force, force_wander))


@kernel
def sample(
    imu: Imu,
    errors: InertialErrors,
    force: Vector3,
    rates: Vector3,
    time_us: int,
    bias: Vector,
    transit: Vector,
    latest: Vector,
    table: DrawTable,
) -> bool:
    """Sample if due; return whether ``latest`` is new in this tick.

    Parameters
    ----------
    imu, errors
        Parameters, and errors of this run.
    force, rates : tuple of 3 floats
        True specific force (m/s2) and angular rate (rad/s), FRD.
    time_us : int
        Vehicle time.
    bias : ndarray, shape (6,)
        Sum of turn-on bias and wander of gyros (rad/s) and accelerometers (m/s2); updated.
    transit : ndarray, shape (slots, READING)
        Readings in transit; updated.
    latest : ndarray, shape (READING,)
        Receives the reading that arrives.
    table : DrawTable
        Random numbers.
    """
    if imu.timing.period_us == 0:
        return False
    if time_us % WANDER_PERIOD_US == 0:
        _step_wander(imu, errors, bias, table)
    if is_due(imu.timing, time_us):
        reading = row(imu.timing, transit, time_us)
        _read(imu, errors, force, rates, bias, table, reading)
        drop(imu.timing, reading, table, draws.IMU)
    return deliver(imu.timing, transit, time_us, latest)


@kernel
def _read(
    imu: Imu,
    errors: InertialErrors,
    force: Vector3,
    rates: Vector3,
    bias: Vector,
    table: DrawTable,
    reading: Vector,
) -> None:
    """Write a reading of the true motion with all errors."""
    n = draws.take(table, draws.IMU, READING)
    reading[0], reading[1], reading[2] = apply_errors(
        force,
        errors.accelerometer_axes,
        (bias[3], bias[4], bias[5]),
        imu.accelerometer_noise_mps2,
        n[0],
        n[1],
        n[2],
    )
    reading[3], reading[4], reading[5] = apply_errors(
        rates,
        errors.gyro_axes,
        (bias[0], bias[1], bias[2]),
        imu.gyro_noise_radps,
        n[3],
        n[4],
        n[5],
    )


@kernel
def _step_wander(imu: Imu, errors: InertialErrors, bias: Vector, table: DrawTable) -> None:
    """Advance the wander of all axes by one of its time steps."""
    # b <- m + a (b - m) + sd sqrt(1 - a^2) n, with m the turn-on bias; see ``build``.
    gyro = imu.wander_noise_gain * imu.gyro_wander_radps
    force = imu.wander_noise_gain * imu.accelerometer_wander_mps2
    for i in range(6):
        mean = errors.gyro_turn_on_radps[i] if i < 3 else errors.accelerometer_turn_on_mps2[i - 3]
        noise = (gyro if i < 3 else force) * draw(table, draws.IMU)
        bias[i] = mean + imu.wander_decay * (bias[i] - mean) + noise


def _add(a: Vector3, b: Vector3) -> Vector3:
    """Return the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
