"""What a check-case yields, and what of it counts as a pass.

A case is a module of ``tests.reference.cases``. Its docstring says what it verifies, what it leaves
out, where the reference comes from and how the tolerance was chosen, as NASA's flight check-cases
do (NESC 2015, "Check-cases for verification of 6-degree-of-freedom flight vehicle simulations").
Its ``checks()`` yields a ``Check`` for every figure."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

HEADINGS = ("Verifies:", "Leaves out:", "Reference:", "Tolerance:")
"""What every case's docstring says, in this order."""


class Check(NamedTuple):
    """One figure of the simulator beside its reference."""

    quantity: str
    unit: str
    value: float
    reference: float
    tolerance: float
    """Largest difference that passes, in ``unit``."""
    source: str
    """Where ``reference`` comes from."""

    @property
    def passed(self) -> bool:
        """Within tolerance; not-a-number never is."""
        return bool(abs(self.value - self.reference) <= self.tolerance)


def relative(
    quantity: str, unit: str, value: float, reference: float, part: float, source: str
) -> Check:
    """A figure allowed to miss its reference by ``part`` of it."""
    return Check(
        quantity, unit, float(value), float(reference), part * abs(float(reference)), source
    )


def worst(
    quantity: str,
    unit: str,
    values: ArrayLike,
    references: ArrayLike,
    tolerance: float,
    source: str,
) -> Check:
    """The largest difference between many figures and their references, which should be nothing."""
    return Check(
        quantity,
        unit,
        float(np.max(np.abs(np.subtract(values, references)))),
        0.0,
        tolerance,
        source,
    )


def title(case: ModuleType) -> str:
    """The name of a case as the table prints it."""
    return case.__name__.rpartition(".")[2].replace("_", " ")


def run(case: ModuleType) -> Iterator[Check]:
    """Every figure of a case."""
    yield from case.checks()
