"""The magnetometer: the earth's field through what is left of the vehicle's hard and soft iron
after compensation."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.frames import Vector, rotate_back
from sitl.core.environment import Environment
from sitl.core.sensors.datasheets import MagnetometerSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.sensors.three_axis import (
    IDENTITY,
    ZERO,
    Matrix,
    apply_errors,
    biases,
    soft_iron,
    white_noise_sd,
)
from sitl.core.truth import Truth


class Magnetometer(NamedTuple):
    timing: Timing
    noise_gauss: float
    hard_iron_gauss: float
    soft_iron: float
    """One standard deviation of each: of the bias, and of the distortion's entries."""


class MagnetometerState(NamedTuple):
    distortion: Matrix = IDENTITY
    bias_gauss: Vector = ZERO
    held: Vector = ZERO
    """The newest reading that arrived, gauss in FRD axes."""
    queue: Queue[Vector] = ()


def build(sheet: MagnetometerSheet, tick_us: int) -> Magnetometer:
    when = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    noise = white_noise_sd(1e-3 * sheet.density_mgauss_rthz, 1e6 / when.period_us)
    return Magnetometer(when, noise, 1e-3 * sheet.hard_iron_mgauss, sheet.soft_iron)


def initial_state(magnetometer: Magnetometer, stream: NoiseStream) -> MagnetometerState:
    """The iron of this run."""
    bias = biases(magnetometer.hard_iron_gauss, stream)
    return MagnetometerState(soft_iron(magnetometer.soft_iron, stream), bias)


def sample(
    magnetometer: Magnetometer,
    truth: Truth,
    sea: Environment,
    memory: MagnetometerState,
    stream: NoiseStream,
) -> tuple[MagnetometerState, bool]:
    """``memory.held`` is what the instrument reads; True when it is new."""
    distortion, bias, held, queue = memory
    taken, time_us = None, truth.time_us
    if is_due(magnetometer.timing, time_us):
        field = rotate_back(truth.attitude_q, sea.magnetic_field_ned_gauss)
        n_x, n_y, n_z = stream.normals(3)
        taken = apply_errors(field, distortion, bias, magnetometer.noise_gauss, n_x, n_y, n_z)
    queue, reading = queue_reading(magnetometer.timing, queue, taken, time_us, stream)
    return MagnetometerState(distortion, bias, reading or held, queue), reading is not None
