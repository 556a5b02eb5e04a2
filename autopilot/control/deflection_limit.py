"""Limit of the time at full deflection that one sensor alone can command. Pure.

Attitude is measured twice: the gyro carries it, and accelerometer and magnetometer show it at once.
With e the error of a loop by the attitude estimate, which the gyro dominates for seconds, and e_a
the rotation from the estimate to accelerometer and magnetometer (``estimator.attitude_errors``),
the command without the rate, of accelerometer and magnetometer, is::

    u_c = P (e - e_a) + I + trim + feedforward

For an LQG controller it is the command itself minus P e_a, with P its gain from a set-point of the
angle to the command, which contains the rate.

A command above ``REDUCED`` of the travel is *confirmed* if u_c has its sign and at least
``CONFIRMED`` of the travel: then two sensors ask for it, as in a turn towards a new heading.
Otherwise gyro or accelerometer and magnetometer are wrong or not used (e_a is NaN), or the rate
alone asks for it. Such a command lasts for ``FULL_S``, and is limited to ``REDUCED`` of the travel
after that.

The confirmation counts only on the way to a new set-point. A vehicle that has reached its set-point
needs no full travel without a fault, but a wrong sensor can lead it to an attitude from which all
sensors ask for it: a delayed gyro makes the loop swing, and a tilt that a wrong gyro has left turns
the levelled magnetic field.
"""

import math

from mavlink_io.jit import numeric

FULL_S = 0.4
"""Longest time above ``REDUCED`` without confirmation."""
REDUCED, CONFIRMED = 0.8, 0.7
"""Limit of a command that is not confirmed, and least confirming command: fractions of the travel.

A healthy turn with this command has P e > 0.8 travel + D r: the difference, 1.5 deg and D r, is
left for the errors of accelerometer and magnetometer in the turn."""


@numeric
def limit_deflection(
    command_rad: float, confirming_rad: float, full_s: float, travel_rad: float, dt_s: float
) -> tuple[float, float]:
    """Limit a command that is not confirmed and has been near full travel for ``FULL_S``.

    Parameters
    ----------
    command_rad : float
        Command of a loop, trim included.
    confirming_rad : float
        Command u_c of accelerometer and magnetometer; NaN if it is unknown or does not count.
    full_s : float
        Time above ``REDUCED`` without confirmation after the last tick; it decreases again as fast
        as it has grown.
    travel_rad : float
        Maximum angle of the duct.
    dt_s : float
        Time since the last tick.

    Returns
    -------
    tuple[float, float]
        Limited command and new time.
    """
    confirmed = math.copysign(1.0, command_rad) * confirming_rad >= CONFIRMED * travel_rad
    if abs(command_rad) <= REDUCED * travel_rad or confirmed:
        return command_rad, max(0.0, full_s - dt_s)
    if full_s + dt_s > FULL_S:
        return math.copysign(REDUCED * travel_rad, command_rad), FULL_S
    return command_rad, full_s + dt_s
