"""PID controller with a measured rate as derivative and conditional anti-windup. Pure."""

import math
from typing import NamedTuple

from mavlink_io.jit import numeric


class Gains(NamedTuple):
    """PID gains, in the unit of the output over that of the error."""

    p: float
    d: float
    """Gain of the measured rate."""
    i: float
    """Gain of the integral of the error (per s)."""
    i_max: float
    """Limit of the integrator, in the unit of the output."""
    i_rate: float = math.inf
    """Measured rate above which the integrator is frozen."""


@numeric
def pid(
    error: float, rate: float, gains: Gains, integral: float, dt_s: float, low: float, high: float
) -> tuple[float, float]:
    """Compute the output of a PID controller for one tick.

    With e the error and y' the measured rate of the controlled quantity::

        u = P e - D y' + I, limited to [low, high]        I <- I + K_i e dt, |I| <= i_max

    Parameters
    ----------
    error : float
        Set-point minus measurement.
    rate : float
        Rate of the measurement, so that a new set-point causes no kick.
    gains : Gains
        Gains and limits of the integrator.
    integral : float
        Integrator I after the last tick, in the unit of the output, so that new gains
        cause no jump.
    dt_s : float
        Time since the last tick.
    low, high : float
        Limits of the output.

    Returns
    -------
    tuple[float, float]
        Output and new integral.

    Notes
    -----
    The integrator is frozen while the output is at a limit and the error pushes further out
    (conditional integration, Astrom and Murray 2008, section 10.4), and while the rate
    exceeds ``i_rate``: the error during a manoeuvre is transient.
    """
    p, d, i, i_max, i_rate = gains
    wanted = p * error - d * rate + integral
    output = min(high, max(low, wanted))
    pushes_out = (wanted > high and error > 0.0) or (wanted < low and error < 0.0)
    if not pushes_out and abs(rate) <= i_rate:
        integral = min(i_max, max(-i_max, integral + i * error * dt_s))
    return output, integral
