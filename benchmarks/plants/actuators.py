"""Surfaces of the plants: delay, lag, rate limit, and stiction, play or steps.

Each axis advances by ``STEP_S``. State: angle before the play, its rate, angle behind the play,
lift angle, and whether the drive moves.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 0.004
"""Time step of the simulation."""
SECOND_ORDER, FIRST_ORDER, SERVO = range(3)
"""Kinds of drives."""
STATES = 5


class Axis(NamedTuple):
    """One surface."""

    kind: int
    delay_s: float
    omega_radps: float
    """Bandwidth: natural frequency, inverse time constant or gain of the position loop."""
    damping: float
    """Damping ratio of a second-order drive."""
    rate_radps: float
    bias_rad: float
    play_rad: float = 0.0
    """Play between drive and surface, full width."""
    step_rad: float = 0.0
    """Resolution of the command."""
    breakaway_rad: float = 0.0
    """Error at which a drive that sticks starts; it stops at a tenth of it."""
    dead_rad: float = 0.0
    """Dead band of the servo, to either side."""
    lift_lag_s: float = 0.0
    """Time constant of the lift behind the surface."""


@njit(cache=True)
def advance(state: Array, command_rad: float, axis: Axis) -> float:
    """Advance one step with the delayed command; return the angle that makes lift."""
    dt = STEP_S
    goal = command_rad
    if axis.step_rad > 0.0:
        goal = axis.step_rad * math.floor(goal / axis.step_rad + 0.5)
    error = goal - state[0]
    if axis.kind == SECOND_ORDER:
        acceleration = (
            axis.omega_radps**2 * error - 2.0 * axis.damping * axis.omega_radps * state[1]
        )
        state[1] += dt * acceleration
        state[1] = min(max(state[1], -axis.rate_radps), axis.rate_radps)
    elif axis.kind == FIRST_ORDER:
        if abs(error) > axis.breakaway_rad:
            state[4] = 1.0
        elif abs(error) < 0.1 * axis.breakaway_rad:
            state[4] = 0.0
        rate = axis.omega_radps * error * state[4]
        state[1] = min(max(rate, -axis.rate_radps), axis.rate_radps)
    else:
        moved = math.copysign(max(abs(error) - axis.dead_rad, 0.0), error)
        state[1] = min(max(axis.omega_radps * moved, -axis.rate_radps), axis.rate_radps)
    state[0] += dt * state[1]
    half = 0.5 * axis.play_rad
    state[2] = min(max(state[2], state[0] - half), state[0] + half)
    surface = state[2] + axis.bias_rad
    if axis.lift_lag_s > 0.0:
        state[3] += dt / axis.lift_lag_s * (surface - state[3])
        return float(state[3])
    state[3] = surface
    return float(surface)


def response(axis: Axis, omega_radps: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the response from command to lift angle for motion well beyond play and stiction."""
    s = 1j * omega_radps
    x = s / axis.omega_radps
    second_order = axis.kind == SECOND_ORDER
    inverse = x**2 + 2.0 * axis.damping * x + 1.0 if second_order else x + 1.0
    return np.asarray(np.exp(-s * axis.delay_s) / (inverse * (1.0 + s * axis.lift_lag_s)))
