"""Result of a check-case, and the criterion of a pass.

A case is a module of ``tests.reference.cases``. Its docstring states what it verifies, what it
leaves out, the source of the reference and the reason of the tolerance, as NASA's flight
check-cases do (NESC 2015, "Check-cases for verification of 6-degree-of-freedom flight vehicle
simulations"). Its ``checks()`` yields one ``Check`` per value.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

HEADINGS = ("Verifies:", "Leaves out:", "Reference:", "Tolerance:")
"""Headings in the docstring of each case, in this order."""


class Check(NamedTuple):
    """Value of the simulator with its reference."""

    quantity: str
    unit: str
    value: float
    reference: float
    tolerance: float
    """Maximum difference that passes, in ``unit``."""
    source: str
    """Source of ``reference``."""

    @property
    def passed(self) -> bool:
        """Return True if the difference is within tolerance; False for not-a-number."""
        return bool(abs(self.value - self.reference) <= self.tolerance)


def relative(
    quantity: str, unit: str, value: float, reference: float, part: float, source: str
) -> Check:
    """Return a check with a tolerance of ``part`` times the reference."""
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
    """Return a check that the largest difference of many values and references is zero."""
    return Check(
        quantity,
        unit,
        float(np.max(np.abs(np.subtract(values, references)))),
        0.0,
        tolerance,
        source,
    )


def title(case: ModuleType) -> str:
    """Return the name of a case for the table."""
    return case.__name__.rpartition(".")[2].replace("_", " ")


def run(case: ModuleType) -> Iterator[Check]:
    """Yield all checks of a case."""
    yield from case.checks()
