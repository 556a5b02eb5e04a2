"""All cells of the study by name, with their cases."""

from collections.abc import Callable
from typing import NamedTuple

from benchmarks.redesign import changes, faults, missions, probability, robust, steady
from benchmarks.redesign.campaign import Values
from benchmarks.study import Cell

Gains = Callable[[], dict[str, Values]]
"""Return the sets of gains to compare; the first call runs a campaign."""


class Question(NamedTuple):
    """A cell and its cases."""

    cases: tuple[str, ...]
    cell: Callable[[Gains], Cell]


QUESTIONS = {
    "steady": Question(steady.SEAS, lambda gains: steady.cell(gains())),
    "robust": Question(robust.CASES, lambda gains: robust.cell(gains())),
    "changes": Question(changes.CASES, lambda gains: changes.cell(gains())),
    "missions": Question(missions.CASES, lambda gains: missions.cell(gains())),
    "probability": Question(probability.CASES, lambda gains: probability.CELL),
    "faults": Question(tuple(faults.FAULTS), lambda gains: faults.cell(gains())),
}
