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
from sitl.core.sensors.noise import Draws
from sitl.core.sensors.sample_timing import Queue, Timing, arrive, due, timing
from sitl.core.sensors.three_axis import (
    NOTHING,
    PERFECT,
    Matrix,
    biases,
    imperfect_axes,
    measured,
    white,
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


class Motion(NamedTuple):
    """One reading, FRD axes."""

    specific_force_mps2: Vector = NOTHING
    rates_radps: Vector = NOTHING


class Errors(NamedTuple):
    gyro_axes: Matrix
    accelerometer_axes: Matrix
    gyro_turn_on_radps: Vector
    accelerometer_turn_on_mps2: Vector
    gyro_bias_radps: Vector
    accelerometer_bias_mps2: Vector
    """Turn-on bias and wander together, as they stand."""


class Memory(NamedTuple):
    errors: Errors = Errors(PERFECT, PERFECT, NOTHING, NOTHING, NOTHING, NOTHING)
    held: Motion = Motion()
    """The newest reading that arrived."""
    queue: Queue[Motion] = ()


def build(sheet: ImuSheet, tick_us: int) -> Imu:
    when = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    rate_hz = 1e6 / when.period_us
    keep = exp(-WANDER_PERIOD_US * 1e-6 / sheet.wander_time_s)
    return Imu(
        when,
        white(radians(sheet.gyro_density_degps_rthz), rate_hz),
        white(sheet.accelerometer_density_ug_rthz * _MICRO_G, rate_hz),
        radians(sheet.gyro_stability_degph) * _PER_HOUR / ALLAN_PEAK,
        sheet.accelerometer_stability_ug * _MICRO_G / ALLAN_PEAK,
        keep,
        sqrt(1.0 - keep * keep),
        sheet,
    )


def switch_on(imu: Imu, stream: Draws) -> Memory:
    """The errors that this run's instrument has."""
    sheet = imu.sheet
    gyro = biases(radians(sheet.gyro_turn_on_degph) * _PER_HOUR, stream)
    accelerometer = biases(sheet.accelerometer_turn_on_ug * _MICRO_G, stream)
    scale, skew = 1e-6 * sheet.scale_ppm, radians(sheet.misalignment_deg)
    errors = Errors(
        imperfect_axes(scale, skew, stream),
        imperfect_axes(scale, skew, stream),
        gyro,
        accelerometer,
        _plus(gyro, biases(imu.gyro_wander_radps, stream)),
        _plus(accelerometer, biases(imu.accelerometer_wander_mps2, stream)),
    )
    return Memory(errors)


def sample(imu: Imu, truth: Truth, memory: Memory, stream: Draws) -> tuple[Memory, bool]:
    """``memory.held`` is what the instrument reads; True when it is new."""
    errors, held, queue = memory
    time_us = truth.time_us
    if time_us % WANDER_PERIOD_US == 0:
        errors = _wandered(imu, errors, stream)
    taken = _read(imu, truth, errors, stream) if due(imu.timing, time_us) else None
    queue, reading = arrive(imu.timing, queue, taken, time_us, stream)
    return Memory(errors, reading or held, queue), reading is not None


def _read(imu: Imu, truth: Truth, errors: Errors, stream: Draws) -> Motion:
    a, b, c, d, e, f = stream.normals(6)
    force = measured(
        truth.specific_force_mps2,
        errors.accelerometer_axes,
        errors.accelerometer_bias_mps2,
        imu.accelerometer_noise_mps2,
        a,
        b,
        c,
    )
    rates = measured(
        truth.rates_radps, errors.gyro_axes, errors.gyro_bias_radps, imu.gyro_noise_radps, d, e, f
    )
    return Motion(force, rates)


def _wandered(imu: Imu, errors: Errors, stream: Draws) -> Errors:
    n = stream.normals(6)
    gyro, force = imu.renew * imu.gyro_wander_radps, imu.renew * imu.accelerometer_wander_mps2
    return errors._replace(
        gyro_bias_radps=_step(
            errors.gyro_bias_radps, errors.gyro_turn_on_radps, imu.keep, gyro, n[:3]
        ),
        accelerometer_bias_mps2=_step(
            errors.accelerometer_bias_mps2,
            errors.accelerometer_turn_on_mps2,
            imu.keep,
            force,
            n[3:],
        ),
    )


def _step(bias: Vector, centre: Vector, keep: float, renew: float, draws: list[float]) -> Vector:
    x, y, z = (c + keep * (b - c) + renew * n for b, c, n in zip(bias, centre, draws, strict=True))
    return x, y, z


def _plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
