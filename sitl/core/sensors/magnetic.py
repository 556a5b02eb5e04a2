"""The magnetometer: Earth's field with the hard- and soft-iron errors left after compensation.

    measured = A B + b + n

B: Earth's field in FRD. A: identity plus symmetric soft-iron distortion. b: hard-iron bias.
n: white noise.
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.frames import Quaternion, rotate_back
from mavlink_io.frames import Vector as Vector3
from mavlink_io.jit import kernel
from sitl.core import draws
from sitl.core.draws import Draws, DrawTable
from sitl.core.sensors.datasheets import MagnetometerSheet
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, drop, is_due, row, timing
from sitl.core.sensors.three_axis import (
    IDENTITY,
    ZERO,
    Matrix,
    apply_errors,
    biases,
    soft_iron,
    white_noise_sd,
)
from sitl.vehicle.vectors import Vector

READING = 3
"""Length of a reading: field (gauss), FRD."""


class Magnetometer(NamedTuple):
    """Parameters of the magnetometer."""

    timing: Timing = NOT_FITTED
    noise_gauss: float = 0.0
    """Standard deviation of the white noise of a sample."""
    hard_iron_gauss: float = 0.0
    soft_iron: float = 0.0
    """Standard deviations over runs of the bias and of the distortion's elements."""


class MagneticErrors(NamedTuple):
    """Errors that are constant during a run."""

    distortion: Matrix = IDENTITY
    bias_gauss: Vector3 = ZERO


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


def initial_errors(magnetometer: Magnetometer, stream: Draws) -> MagneticErrors:
    """Draw the iron errors of this run."""
    bias = biases(magnetometer.hard_iron_gauss, stream, draws.MAGNETOMETER)
    return MagneticErrors(soft_iron(magnetometer.soft_iron, stream, draws.MAGNETOMETER), bias)


@kernel
def sample(
    magnetometer: Magnetometer,
    errors: MagneticErrors,
    attitude_q: Quaternion,
    field_ned_gauss: Vector3,
    time_us: int,
    transit: Vector,
    latest: Vector,
    table: DrawTable,
) -> bool:
    """Sample if due; return whether ``latest`` is new in this tick.

    Parameters
    ----------
    magnetometer, errors
        Parameters, and errors of this run.
    attitude_q : tuple of 4 floats
        True rotation from FRD to NED.
    field_ned_gauss : tuple of 3 floats
        Earth's magnetic field.
    time_us : int
        Vehicle time.
    transit : ndarray, shape (slots, READING)
        Readings in transit; updated.
    latest : ndarray, shape (READING,)
        Receives the reading that arrives.
    table : DrawTable
        Random numbers.
    """
    if is_due(magnetometer.timing, time_us):
        n = draws.take(table, draws.MAGNETOMETER, READING)
        reading = row(magnetometer.timing, transit, time_us)
        reading[0], reading[1], reading[2] = apply_errors(
            rotate_back(attitude_q, field_ned_gauss),
            errors.distortion,
            errors.bias_gauss,
            magnetometer.noise_gauss,
            n[0],
            n[1],
            n[2],
        )
        drop(magnetometer.timing, reading, table, draws.MAGNETOMETER)
    return deliver(magnetometer.timing, transit, time_us, latest)
