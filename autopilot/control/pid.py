"""One PID with the derivative from a measured rate and an integrator that stops where its actuator
does."""

import math
from typing import NamedTuple


class Gains(NamedTuple):
    p: float
    d: float
    i: float
    i_max: float
    """Limit of the integrator, in the unit of the output."""
    i_rate: float = math.inf
    """Measured rate above which the integrator waits."""


def pid(
    error: float, rate: float, gains: Gains, integral: float, dt_s: float, low: float, high: float
) -> tuple[float, float]:
    """The output within [low, high], and the integral to hand to the next call.

    ``rate`` is the measured rate of the controlled quantity, so that a new set-point causes no
    kick. The integral is kept in the output's unit, so that new gains cause no bump, and stands
    still while the output is at a limit and the error pushes further out (conditional anti-windup,
    Astrom and Murray 2008, section 10.4). It also waits while the vehicle moves faster than
    ``i_rate``: the error on the way to a new set-point is none to carry for good."""
    p, d, i, i_max, i_rate = gains
    wanted = p * error - d * rate + integral
    output = min(high, max(low, wanted))
    pushes_out = (wanted > high and error > 0.0) or (wanted < low and error < 0.0)
    if not pushes_out and abs(rate) <= i_rate:
        integral = min(i_max, max(-i_max, integral + i * error * dt_s))
    return output, integral
