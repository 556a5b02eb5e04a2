"""Every cell of the study by name, and what each is asked of."""

from collections.abc import Callable
from typing import NamedTuple

from benchmarks.redesign import faults, missions, probability, robust, steady
from benchmarks.redesign.campaign import Values
from benchmarks.study import Cell

Gains = Callable[[], dict[str, Values]]
"""The sets of gains that are compared; a campaign is flown for them when first asked."""


class Question(NamedTuple):
    cases: tuple[str, ...]
    cell: Callable[[Gains], Cell]


QUESTIONS = {
    "steady": Question(steady.SEAS, lambda gains: steady.cell(gains())),
    "robust": Question(robust.CASES, lambda gains: robust.cell(gains())),
    "missions": Question(missions.CASES, lambda gains: missions.cell(gains())),
    "probability": Question(probability.CASES, lambda gains: probability.CELL),
    "faults": Question(tuple(faults.FAULTS), lambda gains: faults.cell(gains())),
}
