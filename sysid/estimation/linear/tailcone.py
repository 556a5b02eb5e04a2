"""Duct angle for a command, and its derivatives by the tailcone's values.

The recursion is that of `greybox.duct_angles`. Over a sample h the exact second-order lag is, with
e = angle - target, x its rate, wd = wn sqrt(1 - zeta^2), c = e^(-zeta wn h) cos(wd h), s = e^(-zeta
wn h) sin(wd h) / wd::

    e' = (c + zeta wn s) e + s x
    x' = -wn^2 s e + (c - zeta wn s) x

At the rate limit the angle moves by rate h independent of the lag, so that its derivatives stay; at
a stop the angle is constant, and its derivatives are zero.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import kernel
from sitl.core.tailcone import lag_transition
from sysid.data.runs import RATE_HZ
from sysid.models import greybox
from sysid.models.greybox import Actuator

Array = NDArray[np.float64]

DT = 1.0 / RATE_HZ
"""Sample of the command, s."""
DELAY_STEP_S = 2e-3
"""Half the difference step of the delay, s.

The command is linear between samples and has kinks at them.
"""
COMPLEX_STEP = 1e-30
"""Imaginary step of the derivatives of the lag, which have no cancellation error."""


DELAY, BIAS, FREQUENCY, DAMPING = range(4)
"""Indices of the tailcone's values."""


class TailconeSensitivity(NamedTuple):
    """Duct angle and its derivatives."""

    angle_rad: Array
    """(samples,), duct angle, rad."""
    slopes: Array
    """(TAIL, samples), derivatives by delay (s), bias (rad), frequency (rad/s) and damping."""


def angles(command_rad: Array, actuator: Actuator) -> Array:
    """Return the duct angle (samples,) on the 50 Hz grid, rad."""
    duct_rad: Array = greybox.duct_angles(command_rad, actuator, DT)
    return duct_rad


def angle_sensitivity(command_rad: Array, actuator: Actuator) -> TailconeSensitivity:
    """Return duct angle and derivatives, for an actuator without backlash."""
    # Derivatives of the lag by a complex step: dPhi/dp = Im Phi(p + i eps) / eps (Squire and Trapp
    # 1998, SIAM Review 40); by the delay: a central difference, one-sided at a delay of 0.
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    by_frequency = _lag(wn + 1j * COMPLEX_STEP, zeta).imag / COMPLEX_STEP
    by_damping = _lag(wn, zeta + 1j * COMPLEX_STEP).imag / COMPLEX_STEP
    lag_slopes = np.stack([np.zeros(4), np.zeros(4), by_frequency, by_damping])
    limited_rad = np.clip(command_rad, -actuator.travel_rad, actuator.travel_rad)
    early_s, late_s = max(actuator.delay_s - DELAY_STEP_S, 0.0), actuator.delay_s + DELAY_STEP_S
    by_delay = (_delay(limited_rad, late_s) - _delay(limited_rad, early_s)) / (late_s - early_s)
    start_rad = float(command_rad[0])
    return TailconeSensitivity(
        *_lag_sensitivity(
            _delay(limited_rad, actuator.delay_s),
            by_delay,
            start_rad,
            actuator,
            _lag(wn, zeta).real,
            lag_slopes,
        )
    )


def _lag(wn: complex, zeta: complex) -> NDArray[np.complex128]:
    """Return the factors of angle error and rate over a sample: two each for error and rate."""
    return np.array(lag_transition(wn, zeta, DT))


def _delay(command: Array, delay_s: float) -> Array:
    """Delayed command; within a sample the mean of two values, exact to second order in DT."""
    whole = int(delay_s / DT)
    newer, older = _shift(command, whole), _shift(command, whole + 1)
    return newer + (delay_s / DT - whole) * (older - newer)


def _shift(command: Array, samples: int) -> Array:
    """Return the command delayed by whole samples; the first value is repeated."""
    shift = min(samples, command.size)
    return np.concatenate([np.full(shift, command[0]), command[: command.size - shift]])


@kernel
def _lag_sensitivity(
    target: Array,
    target_slope: Array,
    start: float,
    actuator: Actuator,
    lag: Array,
    lag_slopes: Array,
) -> tuple[Array, Array]:
    """Propagate angle, rate and their derivatives through lag, rate limit and stops.

    ``target`` (samples,) is the delayed command, ``target_slope`` its derivative by the delay,
    ``lag`` (4,) the factors of `_lag` and ``lag_slopes`` (4, 4) their derivatives by each value.
    """
    # Recursion (e, x) <- Phi (e, x): module docstring. Its derivative by a value p, with u target:
    #     da' = du + Phi_11 (da - du) + Phi_12 dx + dPhi_11 e + dPhi_12 x,
    #     dx' =      Phi_21 (da - du) + Phi_22 dx + dPhi_21 e + dPhi_22 x.
    n, travel, rate_limit = target.size, actuator.travel_rad, actuator.rate_radps
    angle_rad, slopes = np.empty(n), np.empty((4, n))
    error_to_error, rate_to_error, error_to_rate, rate_to_rate = lag
    angle, rate = start, 0.0
    angle_slopes, rate_slopes = np.zeros(4), np.zeros(4)
    for k in range(n):
        angle_rad[k] = angle + actuator.bias_rad
        error = angle - target[k]
        increment = target[k] + error_to_error * error + rate_to_error * rate - angle
        next_rate = error_to_rate * error + rate_to_rate * rate
        slopes[BIAS, k] = 1.0
        for i in (DELAY, FREQUENCY, DAMPING):
            target_derivative = target_slope[k] if i == DELAY else 0.0
            error_slope = angle_slopes[i] - target_derivative
            slopes[i, k] = angle_slopes[i]
            if abs(increment) <= rate_limit * DT:
                angle_slopes[i] = (
                    target_derivative
                    + error_to_error * error_slope
                    + rate_to_error * rate_slopes[i]
                    + lag_slopes[i, 0] * error
                    + lag_slopes[i, 1] * rate
                )
            rate_slopes[i] = (
                error_to_rate * error_slope
                + rate_to_rate * rate_slopes[i]
                + lag_slopes[i, 2] * error
                + lag_slopes[i, 3] * rate
            )
        angle += min(max(increment, -rate_limit * DT), rate_limit * DT)
        rate = min(max(next_rate, -rate_limit), rate_limit)
        if abs(next_rate) > rate_limit:
            rate_slopes[:] = 0.0
        if abs(angle) > travel:
            angle, rate = math.copysign(travel, angle), 0.0
            angle_slopes[:], rate_slopes[:] = 0.0, 0.0
    return angle_rad, slopes
