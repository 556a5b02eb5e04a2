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
    """Advance one step with the delayed command; return the mean angle that makes lift.

    The command is constant during the step. Angle and lift are exact to second order in the step,
    so that the response to slow commands is that of `response`.
    """
    dt = STEP_S
    before, lifting, rate_before = state[2], state[3], state[1]
    goal = command_rad
    if axis.step_rad > 0.0:
        goal = axis.step_rad * math.floor(goal / axis.step_rad + 0.5)
    error = goal - state[0]
    if axis.kind == SECOND_ORDER:
        # Midpoint rule: the acceleration at the angle and the rate of half a step.
        halfway = rate_before + 0.5 * dt * (
            axis.omega_radps**2 * error - 2.0 * axis.damping * axis.omega_radps * rate_before
        )
        acceleration = (
            axis.omega_radps**2 * (error - 0.5 * dt * rate_before)
            - 2.0 * axis.damping * axis.omega_radps * halfway
        )
        state[1] = min(max(rate_before + dt * acceleration, -axis.rate_radps), axis.rate_radps)
        state[0] += dt * 0.5 * (rate_before + state[1])
    elif axis.kind == FIRST_ORDER:
        if abs(error) > axis.breakaway_rad:
            state[4] = 1.0
        elif abs(error) < 0.1 * axis.breakaway_rad:
            state[4] = 0.0
        rate = _approach(axis.omega_radps) * error * state[4]
        state[1] = min(max(rate, -axis.rate_radps), axis.rate_radps)
        state[0] += dt * state[1]
    else:
        moved = math.copysign(max(abs(error) - axis.dead_rad, 0.0), error)
        rate = _approach(axis.omega_radps) * moved
        state[1] = min(max(rate, -axis.rate_radps), axis.rate_radps)
        state[0] += dt * state[1]
    half = 0.5 * axis.play_rad
    state[2] = min(max(state[2], state[0] - half), state[0] + half)
    surface = 0.5 * (before + state[2]) + axis.bias_rad
    if axis.lift_lag_s > 0.0:
        state[3] += (1.0 - math.exp(-dt / axis.lift_lag_s)) * (surface - state[3])
        return float(0.5 * (lifting + state[3]))
    state[3] = surface
    return float(surface)


@njit(cache=True)
def _approach(omega_radps: float) -> float:
    """Return the mean rate over one step, per angle to go, of a first-order lag (1/s)."""
    return (1.0 - math.exp(-STEP_S * omega_radps)) / STEP_S


def response(axis: Axis, omega_radps: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the response from command to lift angle for motion well beyond play and stiction."""
    s = 1j * omega_radps
    x = s / axis.omega_radps
    second_order = axis.kind == SECOND_ORDER
    inverse = x**2 + 2.0 * axis.damping * x + 1.0 if second_order else x + 1.0
    return np.asarray(np.exp(-s * axis.delay_s) / (inverse * (1.0 + s * axis.lift_lag_s)))
