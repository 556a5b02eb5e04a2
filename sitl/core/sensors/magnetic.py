"""The magnetometer: the earth's field through what is left of the vehicle's hard and soft iron
after compensation."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.frames import Vector, rotate_back
from sitl.core.environment import Environment
from sitl.core.sensors.datasheets import MagnetometerSheet
from sitl.core.sensors.noise import Draws
from sitl.core.sensors.sample_timing import Queue, Timing, arrive, due, timing
from sitl.core.sensors.three_axis import (
    NOTHING,
    PERFECT,
    Matrix,
    biases,
    measured,
    soft_iron,
    white,
)
from sitl.core.truth import Truth


class Magnetometer(NamedTuple):
    timing: Timing
    noise_gauss: float
    hard_iron_gauss: float
    soft_iron: float
    """One standard deviation of each: of the bias, and of the distortion's entries."""


class Memory(NamedTuple):
    distortion: Matrix = PERFECT
    bias_gauss: Vector = NOTHING
    held: Vector = NOTHING
    """The newest reading that arrived, gauss in FRD axes."""
    queue: Queue[Vector] = ()


def build(sheet: MagnetometerSheet, tick_us: int) -> Magnetometer:
    when = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    noise = white(1e-3 * sheet.density_mgauss_rthz, 1e6 / when.period_us)
    return Magnetometer(when, noise, 1e-3 * sheet.hard_iron_mgauss, sheet.soft_iron)


def switch_on(magnetometer: Magnetometer, stream: Draws) -> Memory:
    """The iron of this run."""
    bias = biases(magnetometer.hard_iron_gauss, stream)
    return Memory(soft_iron(magnetometer.soft_iron, stream), bias)


def sample(
    magnetometer: Magnetometer, truth: Truth, sea: Environment, memory: Memory, stream: Draws
) -> tuple[Memory, bool]:
    """``memory.held`` is what the instrument reads; True when it is new."""
    distortion, bias, held, queue = memory
    taken, time_us = None, truth.time_us
    if due(magnetometer.timing, time_us):
        field = rotate_back(truth.attitude_q, sea.magnetic_field_ned_gauss)
        n_x, n_y, n_z = stream.normals(3)
        taken = measured(field, distortion, bias, magnetometer.noise_gauss, n_x, n_y, n_z)
    queue, reading = arrive(magnetometer.timing, queue, taken, time_us, stream)
    return Memory(distortion, bias, reading or held, queue), reading is not None
