"""Laws with a model of the vehicle inside: an observer that is told what was commanded, and feedback of its belief.

The belief takes in that a command was cut to the tailcone's travel, so that nothing winds up. Pure Python; the laws are
designed ashore (``sysid.design.optimal``) and read from a file at the start (``autopilot.law_file``).
"""

from operator import mul
from typing import NamedTuple

SLOWEST, FASTEST = 0.8, 1.25
"""Speeds over that of the design between which the laws fly; beyond them the PIDs do."""


class Law(NamedTuple):
    """x[k] = A x[k-1] + B u[k-1] + L (y[k-1] + y[k])/2, u = F x: y is what is measured less what is wanted."""

    rows: tuple[tuple[float, ...], ...]
    """(A B L), a row a state."""
    feedback: tuple[float, ...]
    """F."""


class Laws(NamedTuple):
    """What a law file holds."""

    speed_mps: float
    """That they were designed for."""
    heading: Law
    """From yaw rate (rad/s) and heading (rad) to rudder (rad)."""
    depth: Law
    """From pitch rate (rad/s), pitch (rad), depth (m) and its rate (m/s) to elevator (rad)."""
    pitch_per_metre: float
    """Nose-down pitch (rad) that counts as much as a metre too deep: it turns the pitch limit into one of depth."""


class Belief(NamedTuple):
    """A law's memory."""

    states: tuple[float, ...]
    measured: tuple[float, ...]
    command_rad: float


def act(law: Law, belief: Belief | None, measured: tuple[float, ...], low: float, high: float) -> tuple[float, Belief]:
    """The command within [low, high], about its trim; begins at rest where ``belief`` is None."""
    states, before, command = belief or ((0.0,) * len(law.rows), measured, 0.0)
    told = (*states, command, *(0.5 * (old + new) for old, new in zip(before, measured, strict=True)))
    states = tuple([sum(map(mul, row, told)) for row in law.rows])
    command = min(high, max(low, sum(map(mul, law.feedback, states))))
    return command, Belief(states, measured, command)


def in_range(laws: Laws | None, speed_mps: float) -> bool:
    return laws is not None and SLOWEST * laws.speed_mps < speed_mps < FASTEST * laws.speed_mps
