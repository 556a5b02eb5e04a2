"""Laws with a model of the vehicle inside: an observer that is told what was commanded, and
feedback of its belief.

The belief takes in that a command was cut to the tailcone's travel, so that nothing winds up. Pure
Python; the laws are designed ashore (``sysid.design.lqg``) and read from a file at the start
(``autopilot.control.lqg_file``)."""

from operator import mul
from typing import NamedTuple

MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.8, 1.25
"""Speeds over that of the design between which the laws fly; beyond them the PIDs do."""


class LqgController(NamedTuple):
    """x[k] = A x[k-1] + B u[k-1] + L (y[k-1] + y[k])/2, u = F (x - S r): y is measured, and wanted
    to be r."""

    rows: tuple[tuple[float, ...], ...]
    """(A B L), a row a state."""
    feedback: tuple[float, ...]
    """F."""
    start: tuple[tuple[float, ...], ...]
    """S: the states of a vehicle that moves steadily as is measured, or wanted."""
    forward: tuple[float, ...]
    """-F S."""
    loads: int
    """How many of the states, the last ones, are constant loads."""


class LqgControllers(NamedTuple):
    """What a law file holds."""

    speed_mps: float
    """That they were designed for."""
    heading: LqgController
    """From yaw rate (rad/s) and heading (rad) to rudder (rad)."""
    depth: LqgController
    """From pitch rate (rad/s), pitch (rad), depth (m) and its rate (m/s) to elevator (rad)."""
    pitch_per_metre: float
    """Nose-down pitch (rad) that counts as much as a metre too deep: it turns the pitch limit into
    one of depth."""


class ObserverState(NamedTuple):
    """A law's memory."""

    states: tuple[float, ...]
    measured: tuple[float, ...]
    command_rad: float


class LqgReference(NamedTuple):
    """What a law is asked for."""

    wanted: tuple[float, ...]
    """Of what is measured."""
    ahead_rad: float
    """Command that the way to it takes by itself, about the trim."""
    low: float
    high: float
    """Of the command about its trim."""
    under_way: bool = False
    """On the way to a new set-point: what is off there is no constant load."""


def from_matrices(
    rows: tuple[tuple[float, ...], ...],
    feedback: tuple[float, ...],
    start: tuple[tuple[float, ...], ...],
    loads: int,
) -> LqgController:
    forward = tuple(-sum(map(mul, feedback, column)) for column in zip(*start, strict=True))
    return LqgController(rows, feedback, start, forward, loads)


def step(
    law: LqgController,
    belief: ObserverState | None,
    measured: tuple[float, ...],
    target: LqgReference,
) -> tuple[float, ObserverState]:
    """The command about its trim. A new set-point moves the command and not the belief, which
    follows what happens."""
    if belief is None:
        states = tuple([sum(map(mul, row, measured)) for row in law.start])
    else:
        means = [0.5 * (old + new) for old, new in zip(belief.measured, measured, strict=True)]
        told = (*belief.states, belief.command_rad, *means)
        learnt = len(law.rows) - (law.loads if target.under_way else 0)
        states = (
            tuple([sum(map(mul, row, told)) for row in law.rows[:learnt]]) + belief.states[learnt:]
        )
    wanted = (
        sum(map(mul, law.feedback, states))
        + sum(map(mul, law.forward, target.wanted))
        + target.ahead_rad
    )
    command = min(target.high, max(target.low, wanted))
    return command, ObserverState(states, measured, command)


def in_range(laws: LqgControllers | None, speed_mps: float) -> bool:
    return (
        laws is not None
        and MIN_SPEED_RATIO * laws.speed_mps < speed_mps < MAX_SPEED_RATIO * laws.speed_mps
    )
