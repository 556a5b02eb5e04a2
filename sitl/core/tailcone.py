"""The tailcone: two stepper-driven axes that turn the duct, one for the rudder and one for the
elevator.

A command is limited to the travel, waits a transport delay and is followed by a second-order lag
whose rate is limited. The motor follows that in whole steps. It counts the steps it is told, not
those it makes: a lost step stays lost, and the losses add up. Play between motor and duct takes up
the first of every reversal, and a bias comes on top. Nobody on board sees any of this unless the
vehicle carries an encoder at the duct. For small signals an axis that neither steps nor plays
equals ``exp(-0.3 s) / (s^2/9 + 0.4 s + 1)`` (the paper, "Tailcone dynamics modeling")."""

from __future__ import annotations

from cmath import cos, sin, sqrt
from math import exp, floor, radians
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from sitl.vehicle.config import Tailcone
from sitl.vehicle.jit import Vector, kernel

COMMANDED, RATE, MOTOR, LOST_STEPS, DUCT, QUEUE = range(6)
"""An axis' state: the angle asked of the motor and its rate, the angle that the motor counts, what
it has lost since, the duct's angle without its bias (rad, rad/s), and the commands on their way,
newest first."""


class TailconeAxis(NamedTuple):
    """One axis of the tailcone, discretised exactly over a substep in which its command stands
    still.

    A fault is another value here, by ``_replace``: a rate limit of zero is stuck, a lower one slow.
    """

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
    step_rad: float
    """Of the duct for a step of the motor; 0 turns smoothly."""
    backlash_rad: float
    """Play between motor and duct, from one flank to the other."""
    lost_step_chance: float
    """Of each step while the motor turns faster than ``lost_step_above_radps``; what turns smoothly
    loses none."""
    lost_step_above_radps: float


class AxisMotion(NamedTuple):
    """What an axis did in a tick."""

    axis: Vector
    """Its state at the end."""
    substeps_rad: Vector
    """Mean true duct angle of each substep."""
    end_rad: float
    """True duct angle at the end."""


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
    """Discretise an axis, under- or overdamped; a delay need not be a whole number of substeps."""
    decay = exp(-damping * natural_frequency_radps * substep_s)
    damped_radps = natural_frequency_radps * sqrt(1.0 - damping * damping)
    c = decay * cos(damped_radps * substep_s).real
    s = (
        decay * (sin(damped_radps * substep_s) / damped_radps).real
        if damped_radps
        else decay * substep_s
    )
    substeps = delay_s / substep_s
    whole = int(substeps + 1e-9)
    return TailconeAxis(
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
        step_rad=step_rad,
        backlash_rad=backlash_rad,
        lost_step_chance=lost_step_chance,
        lost_step_above_radps=lost_step_above_radps,
    )


def of_vehicle(tail: Tailcone, bias_deg: float, substep_s: float) -> TailconeAxis:
    """An axis as a vehicle file has it; rudder and elevator differ by their bias."""
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
    """The state of an axis at its neutral, the duct in the middle of its play."""
    return np.zeros(QUEUE + axis.delay_substeps + 1)


def duct_angle_rad(axis: TailconeAxis, state: Vector) -> float:
    """The true angle of the duct about this axis."""
    return float(state[DUCT]) + axis.bias_rad


def step_loss_draws(axis: TailconeAxis, rng: Generator, substeps: int) -> Vector | None:
    """A number in [0, 1) for each substep, by which steps are lost; drawn only for an axis that may
    lose some."""
    return rng.random(substeps) if axis.lost_step_chance > 0.0 else None


def axis_at_rest(axis: TailconeAxis) -> AxisMotion:
    """The axis before anything has moved."""
    state = at_rest(axis)
    return AxisMotion(state, np.empty(0), duct_angle_rad(axis, state))


@kernel
def advance(
    axis: TailconeAxis,
    state: Vector,
    command_rad: float,
    duct_angles_rad: Vector,
    luck: Vector | None = None,
) -> None:
    """Carry an axis through the substeps that ``duct_angles_rad`` has room for, under one command.

    Each entry receives the mean true duct angle of its substep; ``state`` is changed in place.
    ``step_loss_draws`` holds a number for each substep; without it no step is lost."""
    command = min(max(command_rad, -axis.travel_rad), axis.travel_rad)
    oldest = QUEUE + axis.delay_substeps
    half_play = 0.5 * axis.backlash_rad
    for k in range(duct_angles_rad.size):
        # The queue's last entry was given delay_substeps + 1 substeps ago, the one before it
        # delay_substeps ago.
        newer = state[oldest - 1] if axis.delay_substeps > 0 else command
        delayed = newer + axis.delay_remainder * (state[oldest] - newer)
        for i in range(oldest, QUEUE, -1):
            state[i] = state[i - 1]
        state[QUEUE] = command
        _step_lag(axis, state, delayed)
        _step_motor(axis, state, 1.0 if luck is None else luck[k])
        shaft, start = state[MOTOR] - state[LOST_STEPS], state[DUCT]
        state[DUCT] = min(max(start, shaft - half_play), shaft + half_play)
        duct_angles_rad[k] = 0.5 * (start + state[DUCT]) + axis.bias_rad


@kernel
def _step_motor(axis: TailconeAxis, state: Vector, luck: float) -> None:
    """Bring the motor's count to the whole step nearest to what is asked; the shaft may lose some
    on the way."""
    before, angle = state[MOTOR], state[COMMANDED]
    if axis.step_rad > 0.0:
        # Steps are counted away from neutral, so that both sides are alike, and none leads beyond
        # the stop.
        steps = min(
            floor(abs(angle) / axis.step_rad + 0.5), floor(axis.travel_rad / axis.step_rad + 1e-9)
        )
        angle = steps * axis.step_rad if angle >= 0.0 else -steps * axis.step_rad
        if luck < 1.0 and angle != before and abs(state[RATE]) > axis.lost_step_above_radps:
            turned = round(abs(angle - before) / axis.step_rad)
            lost = _lost_steps(turned, axis.lost_step_chance, luck) * axis.step_rad
            state[LOST_STEPS] += lost if angle > before else -lost
    state[MOTOR] = angle


@kernel
def _lost_steps(turned: int, chance: float, luck: float) -> int:
    """How many of the steps turned are lost: the binomial distribution's quantile at
    ``step_loss_draws``."""
    if chance >= 1.0:
        return turned
    lost, share = 0, (1.0 - chance) ** turned
    reached = share
    while luck >= reached and lost < turned:
        share *= (turned - lost) / (lost + 1.0) * chance / (1.0 - chance)
        lost += 1
        reached += share
    return lost


@kernel
def _step_lag(axis: TailconeAxis, state: Vector, command_rad: float) -> None:
    """One substep of the lag towards a constant command, within the rate limit and the stops."""
    error, rate = state[COMMANDED] - command_rad, state[RATE]
    free_angle = command_rad + axis.angle_from_angle * error + axis.angle_from_rate_s * rate
    free_rate = axis.rate_from_angle_per_s * error + axis.rate_from_rate * rate
    reach = axis.rate_limit_radps * axis.substep_s
    angle = state[COMMANDED] + min(max(free_angle - state[COMMANDED], -reach), reach)
    # The rate itself is held within the limit, so that the axis turns round at once when the
    # command does.
    state[RATE] = min(max(free_rate, -axis.rate_limit_radps), axis.rate_limit_radps)
    state[COMMANDED] = min(max(angle, -axis.travel_rad), axis.travel_rad)
    if state[COMMANDED] != angle:
        state[RATE] = 0.0
