"""The tailcone: two axes with stepper motors that turn the duct, for rudder and elevator.

A command is limited to the travel, delayed, and followed by a second-order lag with a rate limit.
The motor follows the lag in whole steps. It counts commanded steps: a lost step stays lost, and
losses add up. Backlash between motor and duct absorbs the first part of each reversal, and a bias
is added. The autopilot cannot measure any of this unless the vehicle has an encoder on the duct.
For small signals, without steps and backlash, an axis has the transfer function
``exp(-0.3 s) / (s^2/9 + 0.4 s + 1)`` (the paper, "Tailcone dynamics modeling").
"""

from __future__ import annotations

from cmath import cos, exp, sin, sqrt
from math import floor, radians
from typing import NamedTuple

import numpy as np

from mavlink_io.jit import entry_point, kernel
from sitl.vehicle.config import Tailcone
from sitl.vehicle.vectors import Vector

COMMANDED, RATE, MOTOR, LOST_STEPS, DUCT, OLDEST, QUEUE = range(7)
"""Indices of an axis state.

COMMANDED and RATE: output of the lag (rad) and its rate (rad/s). MOTOR: angle counted by the motor
(rad). LOST_STEPS: sum of lost steps (rad). DUCT: duct angle without bias (rad). QUEUE and the
following indices: ring of delayed commands (rad). OLDEST: index of the oldest one in the ring; the
next newer one follows it.
"""


class TailconeAxis(NamedTuple):
    """Parameters of one axis; the lag is discretised exactly for a constant command per substep.

    Faults are other parameters, set with ``_replace``: a rate limit of zero means stuck, a lower
    limit means slow.
    """

    angle_from_angle: float
    angle_from_rate_s: float
    rate_from_angle_per_s: float
    rate_from_rate: float
    """Transition matrix of (angle - command, rate) over one substep."""
    substep_s: float
    delay_substeps: int
    """Whole substeps in the delay."""
    delay_remainder: float
    """Remaining fraction of a substep in the delay, 0 to 1."""
    travel_rad: float
    rate_limit_radps: float
    bias_rad: float
    step_rad: float
    """Duct angle per motor step; 0 for a continuous drive."""
    backlash_rad: float
    """Total play between motor and duct."""
    lost_step_chance: float
    """Probability of losing a step while the rate exceeds ``lost_step_above_radps``."""
    lost_step_above_radps: float


def lag_transition(
    natural_frequency_radps: complex, damping: complex, step_s: float
) -> tuple[complex, complex, complex, complex]:
    """Return the transition matrix of (angle - command, rate) of the lag over one step, by rows.

    Parameters
    ----------
    natural_frequency_radps, damping : complex
        Natural frequency and damping ratio; complex for derivatives by a complex step.
    step_s : float
        Length of the step.

    Returns
    -------
    tuple of 4 complex
        Error from error, error from rate (s), rate from error (1/s), rate from rate.

    Notes
    -----
    With the error e = angle - command (rad), natural frequency w (rad/s), damping ratio z and
    step h (s), e'' + 2 z w e' + w^2 e = 0 has the exact solution over one step

        e(t+h)  = (c + z w s) e(t) + s e'(t)
        e'(t+h) = -w^2 s e(t) + (c - z w s) e'(t)
        c = exp(-z w h) cos(wd h),  s = exp(-z w h) sin(wd h) / wd,  wd = w sqrt(1 - z^2)

    where wd is imaginary for z > 1, and s = h exp(-z w h) for z = 1.
    """
    w, z = natural_frequency_radps, damping
    damped_radps = w * sqrt(1.0 - z * z)
    decay = exp(-z * w * step_s)
    c = decay * cos(damped_radps * step_s)
    s = decay * sin(damped_radps * step_s) / damped_radps if damped_radps else decay * step_s
    return c + z * w * s, s, -w * w * s, c - z * w * s


def discretise(
    *,
    natural_frequency_radps: float,
    damping: float,
    delay_s: float,
    travel_rad: float,
    rate_limit_radps: float,
    bias_rad: float,
    substep_s: float,
    step_rad: float = 0.0,
    backlash_rad: float = 0.0,
    lost_step_chance: float = 0.0,
    lost_step_above_radps: float = 0.0,
) -> TailconeAxis:
    """Discretise an axis, under- or overdamped; the delay may be any number of substeps.

    Parameters
    ----------
    natural_frequency_radps, damping : float
        Natural frequency and damping ratio of the second-order lag.
    delay_s : float
        Transport delay of the command.
    travel_rad : float
        Largest duct angle to either side.
    rate_limit_radps : float
        Largest rate of the duct angle.
    bias_rad : float
        Duct angle at a motor count of zero.
    substep_s : float
        Length of a substep.
    step_rad : float
        Duct angle per motor step; 0 for a continuous drive.
    backlash_rad : float
        Total play between motor and duct.
    lost_step_chance : float
        Probability of losing a step above ``lost_step_above_radps``.
    lost_step_above_radps : float
        Rate above which steps may be lost.

    Returns
    -------
    TailconeAxis
        The axis, discretised.

    Notes
    -----
    ``lag_transition`` has the equation of the lag.
    """
    transition = lag_transition(natural_frequency_radps, damping, substep_s)
    substeps = delay_s / substep_s
    whole = int(substeps + 1e-9)
    return TailconeAxis(
        angle_from_angle=transition[0].real,
        angle_from_rate_s=transition[1].real,
        rate_from_angle_per_s=transition[2].real,
        rate_from_rate=transition[3].real,
        substep_s=substep_s,
        delay_substeps=whole,
        delay_remainder=max(0.0, substeps - whole),
        travel_rad=travel_rad,
        rate_limit_radps=rate_limit_radps,
        bias_rad=bias_rad,
        step_rad=step_rad,
        backlash_rad=backlash_rad,
        lost_step_chance=lost_step_chance,
        lost_step_above_radps=lost_step_above_radps,
    )


def from_config(tail: Tailcone, bias_deg: float, substep_s: float) -> TailconeAxis:
    """Build an axis from a vehicle file; rudder and elevator differ by their bias only."""
    return discretise(
        natural_frequency_radps=tail.natural_frequency_radps,
        damping=tail.damping_ratio,
        delay_s=tail.delay_s,
        travel_rad=radians(tail.travel_deg),
        rate_limit_radps=radians(tail.rate_degps),
        bias_rad=radians(bias_deg),
        substep_s=substep_s,
        step_rad=radians(tail.step_deg),
        backlash_rad=radians(tail.backlash_deg),
        lost_step_chance=tail.lost_step_chance,
        lost_step_above_radps=radians(tail.lost_step_above_degps),
    )


def at_rest(axis: TailconeAxis) -> Vector:
    """Return the state of an axis at neutral, with the duct in the middle of the backlash.

    Parameters
    ----------
    axis : TailconeAxis
        Axis to start.

    Returns
    -------
    Vector
        State with the indices ``COMMANDED`` to ``QUEUE``; its length depends on the delay.
    """
    return np.zeros(QUEUE + axis.delay_substeps + 1)


@kernel
def duct_angle_rad(axis: TailconeAxis, state: Vector) -> float:
    """Return the true duct angle about this axis, bias included."""
    return float(state[DUCT]) + axis.bias_rad


@kernel
def advance(
    axis: TailconeAxis,
    state: Vector,
    command_rad: float,
    duct_angles_rad: Vector,
    loss_draws: Vector | None = None,
) -> None:
    """Advance an axis by ``duct_angles_rad.size`` substeps under a constant command, in place.

    ``duct_angles_rad`` receives the mean true duct angle of each substep. ``loss_draws`` has a
    number in [0, 1) per substep; without it no step is lost.
    """
    # Per substep: transport delay T of the limited command c (rad) by linear interpolation, lag
    # (``step_lag``), motor steps (``_step_motor``), then backlash b and bias (rad):
    #     delayed = c_k + f (c_k+1 - c_k),   T = (k + f) h,   c_k the command k substeps ago,
    #     duct <- min(max(duct, shaft - b/2), shaft + b/2),   shaft = motor - lost steps.
    # Delay, lag, rate limit and travel are the paper's ("Tailcone dynamics modeling").
    command, ring, oldest = _limit_travel(axis, command_rad), state[QUEUE:], int(state[OLDEST])
    for k in range(duct_angles_rad.size):
        # The oldest command is delay_substeps + 1 substeps old, the next one delay_substeps; the
        # delayed command is interpolated between them.
        older, ring[oldest] = ring[oldest], command
        oldest = oldest + 1 if oldest < axis.delay_substeps else 0
        newer = ring[oldest]
        delayed = newer + axis.delay_remainder * (older - newer)
        state[COMMANDED], state[RATE] = step_lag(axis, state[COMMANDED], state[RATE], delayed)
        _step_motor(axis, state, 1.0 if loss_draws is None else loss_draws[k])
        start = state[DUCT]
        state[DUCT] = _cross_backlash(axis, start, state[MOTOR] - state[LOST_STEPS])
        duct_angles_rad[k] = 0.5 * (start + state[DUCT]) + axis.bias_rad
    state[OLDEST] = oldest


@entry_point
def respond(axis: TailconeAxis, commands_rad: Vector) -> Vector:
    """Return the true duct angle at every sample of a command, for a motor without steps.

    Parameters
    ----------
    axis : TailconeAxis
        The axis, discretised with the sample of the command.
    commands_rad : ndarray, shape (samples,)
        Command, rad, zero-order hold; the axis is at rest at its first value.

    Returns
    -------
    ndarray, shape (samples,)
        True duct angle, rad.
    """
    # As ``advance``, with the samples themselves as the queue. A command edge inside a sample: the
    # input of the lag is the mean over the sample, exact to second order in its length.
    angles_rad = np.empty(commands_rad.size)
    angle, rate = commands_rad[0], 0.0
    duct_rad = angle
    for k in range(commands_rad.size):
        duct_rad = _cross_backlash(axis, duct_rad, angle)
        angles_rad[k] = duct_rad + axis.bias_rad
        newer = _limit_travel(axis, commands_rad[max(0, k - axis.delay_substeps)])
        older = _limit_travel(axis, commands_rad[max(0, k - axis.delay_substeps - 1)])
        delayed = newer + axis.delay_remainder * (older - newer)
        angle, rate = step_lag(axis, angle, rate, delayed)
    return angles_rad


@kernel
def _limit_travel(axis: TailconeAxis, angle_rad: float) -> float:
    """Return an angle limited to the travel."""
    return min(max(angle_rad, -axis.travel_rad), axis.travel_rad)


@kernel
def _cross_backlash(axis: TailconeAxis, duct_rad: float, shaft_rad: float) -> float:
    """Return the duct angle after the shaft moved: it follows once the play is used up."""
    half_backlash = 0.5 * axis.backlash_rad
    return min(max(duct_rad, shaft_rad - half_backlash), shaft_rad + half_backlash)


@kernel
def _step_motor(axis: TailconeAxis, state: Vector, loss_draw: float) -> None:
    """Move the motor count to the step nearest to the lag's output; steps may be lost."""
    # motor = sign(a) min(floor(|a| / s + 1/2), floor(travel / s)) s, with a the lag's output (rad)
    # and s the step (rad). While the rate exceeds lost_step_above_radps, each step of a move is
    # lost with the same probability (``_lost_steps``).
    before, angle = state[MOTOR], state[COMMANDED]
    if axis.step_rad > 0.0:
        # Steps are counted from neutral, so that the motion is symmetric; no step goes beyond
        # the end stop.
        steps = min(
            floor(abs(angle) / axis.step_rad + 0.5), floor(axis.travel_rad / axis.step_rad + 1e-9)
        )
        angle = steps * axis.step_rad if angle >= 0.0 else -steps * axis.step_rad
        if loss_draw < 1.0 and angle != before and abs(state[RATE]) > axis.lost_step_above_radps:
            turned = round(abs(angle - before) / axis.step_rad)
            lost = _lost_steps(turned, axis.lost_step_chance, loss_draw) * axis.step_rad
            state[LOST_STEPS] += lost if angle > before else -lost
    state[MOTOR] = angle


@kernel
def _lost_steps(turned: int, chance: float, quantile: float) -> int:
    """Return the number of lost steps: the binomial distribution's value at ``quantile``.

    P(0) = (1 - p)^n,  P(k + 1) = P(k) (n - k) / (k + 1) p / (1 - p), for n steps and probability p.
    """
    if chance >= 1.0:
        return turned
    lost, probability = 0, (1.0 - chance) ** turned
    cumulative = probability
    while quantile >= cumulative and lost < turned:
        probability *= (turned - lost) / (lost + 1.0) * chance / (1.0 - chance)
        lost += 1
        cumulative += probability
    return lost


@kernel
def step_lag(
    axis: TailconeAxis, angle: float, rate: float, command_rad: float
) -> tuple[float, float]:
    """Return angle (rad) and rate (rad/s) of the lag after one substep of a constant command.

    Rate limit and end stops apply after the exact lag (see ``lag_transition``).
    """
    # (e, x) <- Phi (e, x), with e = angle - command (rad), x rate (rad/s) and Phi of
    # ``lag_transition``; the change of the angle is limited to rate limit times substep.
    error = angle - command_rad
    free_angle = command_rad + axis.angle_from_angle * error + axis.angle_from_rate_s * rate
    free_rate = axis.rate_from_angle_per_s * error + axis.rate_from_rate * rate
    max_change = axis.rate_limit_radps * axis.substep_s
    free_of_stops = angle + min(max(free_angle - angle, -max_change), max_change)
    next_angle = _limit_travel(axis, free_of_stops)
    # The rate is limited too, so that the axis reverses at once when the command does.
    limited_rate = min(max(free_rate, -axis.rate_limit_radps), axis.rate_limit_radps)
    return next_angle, limited_rate if next_angle == free_of_stops else 0.0
