"""The magnetometer: Earth's field with the hard- and soft-iron errors left after compensation.

    measured = A B + b + n

B: Earth's field in FRD. A: identity plus symmetric soft-iron distortion. b: hard-iron bias.
n: white noise.
"""

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
    """Parameters of the magnetometer."""

    timing: Timing
    noise_gauss: float
    """Standard deviation of the white noise of a sample."""
    hard_iron_gauss: float
    soft_iron: float
    """Standard deviations over runs of the bias and of the distortion's elements."""


class MagnetometerState(NamedTuple):
    """Errors of this run, latest reading, and readings in transit."""

    distortion: Matrix = IDENTITY
    bias_gauss: Vector = ZERO
    latest: Vector = ZERO
    """Latest reading that has arrived, gauss, FRD."""
    queue: Queue[Vector] = ()


def build(sheet: MagnetometerSheet, tick_us: int) -> Magnetometer:
    """Build the magnetometer from its data sheet."""
    schedule = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    noise = white_noise_sd(1e-3 * sheet.density_mgauss_rthz, 1e6 / schedule.period_us)
    return Magnetometer(
        timing=schedule,
        noise_gauss=noise,
        hard_iron_gauss=1e-3 * sheet.hard_iron_mgauss,
        soft_iron=sheet.soft_iron,
    )


def initial_state(magnetometer: Magnetometer, stream: NoiseStream) -> MagnetometerState:
    """Draw the iron errors of this run."""
    bias = biases(magnetometer.hard_iron_gauss, stream)
    return MagnetometerState(soft_iron(magnetometer.soft_iron, stream), bias)


def sample(
    magnetometer: Magnetometer,
    truth: Truth,
    sea: Environment,
    state: MagnetometerState,
    stream: NoiseStream,
) -> tuple[MagnetometerState, bool]:
    """Sample if due; return the new state and whether ``latest`` is new in this tick."""
    distortion, bias, latest, queue = state
    measured, time_us = None, truth.time_us
    if is_due(magnetometer.timing, time_us):
        field = rotate_back(truth.attitude_q, sea.magnetic_field_ned_gauss)
        n_x, n_y, n_z = stream.normals(3)
        measured = apply_errors(field, distortion, bias, magnetometer.noise_gauss, n_x, n_y, n_z)
    queue, reading = queue_reading(magnetometer.timing, queue, measured, time_us, stream)
    return MagnetometerState(distortion, bias, reading or latest, queue), reading is not None
