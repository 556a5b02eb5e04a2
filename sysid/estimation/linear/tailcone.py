"""The duct's angle under commands, and how it changes with the tailcone's delay, frequency and
damping.

The recursion of ``greybox.duct_angles``, differentiated: at the rate limit the angle goes on as far
whatever the lag, at a stop it stands."""

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.jit import kernel
from sysid.data.segments import RATE_HZ
from sysid.models import greybox
from sysid.models.greybox import Actuator

Array = NDArray[np.float64]

DT = 1.0 / RATE_HZ
DELAY_STEP_S = 2e-3
"""Half the difference that gives a delayed command's slope: between samples it is straight, at them
it has a kink."""
COMPLEX_STEP = 1e-30
"""Step of the lag's derivatives: complex, so nothing is lost to a difference."""


DELAY, BIAS, FREQUENCY, DAMPING = range(4)


class TailconeSensitivity(NamedTuple):
    angle_rad: Array
    """(samples,)"""
    slopes: Array
    """(TAIL, samples): of the angle by delay (s), bias (rad), natural frequency (rad/s) and damping
    ratio."""


def angles(command_rad: Array, actuator: Actuator) -> Array:
    """(samples,) on the 50 Hz grid."""
    found: Array = greybox.duct_angles(command_rad, actuator, DT)
    return found


def angle_sensitivity(command_rad: Array, actuator: Actuator) -> TailconeSensitivity:
    """The same and its slopes; of an actuator without play."""
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    by_frequency = _lag(wn + 1j * COMPLEX_STEP, zeta).imag / COMPLEX_STEP
    by_damping = _lag(wn, zeta + 1j * COMPLEX_STEP).imag / COMPLEX_STEP
    lag_slopes = np.stack([np.zeros(4), np.zeros(4), by_frequency, by_damping])
    told = np.clip(command_rad, -actuator.travel_rad, actuator.travel_rad)
    early_s, late_s = max(actuator.delay_s - DELAY_STEP_S, 0.0), actuator.delay_s + DELAY_STEP_S
    by_delay = (_delay(told, late_s) - _delay(told, early_s)) / (late_s - early_s)
    start_rad = float(command_rad[0])
    return TailconeSensitivity(
        *_lag_sensitivity(
            _delay(told, actuator.delay_s),
            by_delay,
            start_rad,
            actuator,
            _lag(wn, zeta).real,
            lag_slopes,
        )
    )


def _lag(wn: complex, zeta: complex) -> NDArray[np.complex128]:
    """(4,): what a sample leaves of an error and of a rate in the error, then in the rate."""
    damped = wn * cmath.sqrt(1.0 - zeta * zeta)
    decay = cmath.exp(-zeta * wn * DT)
    c, s = decay * cmath.cos(damped * DT), decay * cmath.sin(damped * DT) / damped
    return np.array([c + zeta * wn * s, s, -wn * wn * s, c - zeta * wn * s])


def _delay(command: Array, delay_s: float) -> Array:
    """A command edge inside an interval: the lag sees the mean, exact to second order in DT."""
    whole = int(delay_s / DT)
    newer, older = _shift(command, whole), _shift(command, whole + 1)
    return newer + (delay_s / DT - whole) * (older - newer)


def _shift(command: Array, samples: int) -> Array:
    late = min(samples, command.size)
    return np.concatenate([np.full(late, command[0]), command[: command.size - late]])


@kernel
def _lag_sensitivity(
    target: Array,
    target_slope: Array,
    start: float,
    actuator: Actuator,
    lag: Array,
    lag_slopes: Array,
) -> tuple[Array, Array]:
    """``target`` is what the lag sees and its slope that by delay; ``lag_slopes`` are by each value
    of the tailcone."""
    n, travel, fastest = target.size, actuator.travel_rad, actuator.rate_radps
    found, slopes = np.empty(n), np.empty((4, n))
    keeps, gains, slows, runs_on = lag
    angle, rate = start, 0.0
    angles, rates = np.zeros(4), np.zeros(4)
    for k in range(n):
        found[k] = angle + actuator.bias_rad
        error = angle - target[k]
        way = target[k] + keeps * error + gains * rate - angle
        next_rate = slows * error + runs_on * rate
        slopes[BIAS, k] = 1.0
        for i in (DELAY, FREQUENCY, DAMPING):
            later = target_slope[k] if i == DELAY else 0.0
            away = angles[i] - later
            slopes[i, k] = angles[i]
            if abs(way) <= fastest * DT:
                angles[i] = (
                    later
                    + keeps * away
                    + gains * rates[i]
                    + lag_slopes[i, 0] * error
                    + lag_slopes[i, 1] * rate
                )
            rates[i] = (
                slows * away
                + runs_on * rates[i]
                + lag_slopes[i, 2] * error
                + lag_slopes[i, 3] * rate
            )
        angle += min(max(way, -fastest * DT), fastest * DT)
        rate = min(max(next_rate, -fastest), fastest)
        if abs(next_rate) > fastest:
            rates[:] = 0.0
        if abs(angle) > travel:
            angle, rate = math.copysign(travel, angle), 0.0
            angles[:], rates[:] = 0.0, 0.0
    return found, slopes
