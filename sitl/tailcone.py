"""The tailcone: two stepper-driven axes that turn the duct, one for the rudder and one for the elevator.

A command is limited to the travel, waits a transport delay, is followed by a second-order lag whose rate is limited,
and ends where its stepper's own count does. The true duct angle carries a bias that neither the count nor anybody on
board can see: there is no position feedback. For small signals the axis equals ``exp(-0.3 s) / (s^2/9 + 0.4 s + 1)``
(the paper, "Tailcone dynamics modeling").
"""

from __future__ import annotations

from cmath import cos, sin, sqrt
from math import exp
from typing import NamedTuple

import numpy as np

from sitl.vehicle.kernel import Vector, kernel


class Servo(NamedTuple):
    """One axis of the tailcone, discretised exactly over a substep in which its command stands still."""

    angle_from_angle: float
    angle_from_rate_s: float
    rate_from_angle_per_s: float
    rate_from_rate: float
    """Transition of (angle - command, rate) over one substep."""
    substep_s: float
    delay_substeps: int
    delay_remainder: float
    """Part of a substep that the delay exceeds ``delay_substeps`` by, 0..1."""
    travel_rad: float
    rate_limit_radps: float
    bias_rad: float


def servo(
    *,
    natural_frequency_radps: float,
    damping: float,
    delay_s: float,
    travel_rad: float,
    rate_limit_radps: float,
    bias_rad: float,
    substep_s: float,
) -> Servo:
    """Discretise an axis, under- or overdamped; a delay need not be a whole number of substeps."""
    decay = exp(-damping * natural_frequency_radps * substep_s)
    damped_radps = natural_frequency_radps * sqrt(1.0 - damping * damping)
    c = decay * cos(damped_radps * substep_s).real
    s = decay * (sin(damped_radps * substep_s) / damped_radps).real if damped_radps else decay * substep_s
    substeps = delay_s / substep_s
    whole = int(substeps + 1e-9)
    return Servo(
        angle_from_angle=c + damping * natural_frequency_radps * s,
        angle_from_rate_s=s,
        rate_from_angle_per_s=-natural_frequency_radps * natural_frequency_radps * s,
        rate_from_rate=c - damping * natural_frequency_radps * s,
        substep_s=substep_s,
        delay_substeps=whole,
        delay_remainder=max(0.0, substeps - whole),
        travel_rad=travel_rad,
        rate_limit_radps=rate_limit_radps,
        bias_rad=bias_rad,
    )


def at_rest(axis: Servo) -> Vector:
    """The state of an axis at its neutral: (angle, rate, commands on their way, newest first), rad and rad/s."""
    return np.zeros(2 + axis.delay_substeps + 1)


def duct_angle_rad(axis: Servo, state: Vector) -> float:
    """The true angle of the duct about this axis."""
    return float(state[0]) + axis.bias_rad


@kernel
def advance(axis: Servo, state: Vector, command_rad: float, duct_angles_rad: Vector) -> None:
    """Carry an axis through the substeps that ``duct_angles_rad`` has room for, under one command.

    Each entry receives the mean true duct angle of its substep; ``state`` is changed in place.
    """
    command = min(max(command_rad, -axis.travel_rad), axis.travel_rad)
    oldest = 2 + axis.delay_substeps
    for k in range(duct_angles_rad.size):
        # The queue's last entry was given delay_substeps + 1 substeps ago, the one before it delay_substeps ago.
        newer = state[oldest - 1] if axis.delay_substeps > 0 else command
        delayed = newer + axis.delay_remainder * (state[oldest] - newer)
        for i in range(oldest, 2, -1):
            state[i] = state[i - 1]
        state[2] = command
        start = state[0]
        _follow(axis, state, delayed)
        duct_angles_rad[k] = 0.5 * (start + state[0]) + axis.bias_rad


@kernel
def _follow(axis: Servo, state: Vector, command_rad: float) -> None:
    """One substep of the lag towards a constant command, within the rate limit and the stops."""
    error, rate = state[0] - command_rad, state[1]
    free_angle = command_rad + axis.angle_from_angle * error + axis.angle_from_rate_s * rate
    free_rate = axis.rate_from_angle_per_s * error + axis.rate_from_rate * rate
    reach = axis.rate_limit_radps * axis.substep_s
    angle = state[0] + min(max(free_angle - state[0], -reach), reach)
    # The rate itself is held within the limit, so that the axis turns round at once when the command does.
    state[1] = min(max(free_rate, -axis.rate_limit_radps), axis.rate_limit_radps)
    state[0] = min(max(angle, -axis.travel_rad), axis.travel_rad)
    if state[0] != angle:
        state[1] = 0.0
