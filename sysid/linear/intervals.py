"""Intervals of what a plane's estimate leaves wide, by profile likelihood."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sysid import profile
from sysid.linear import plant as plants
from sysid.linear.estimate import Estimate
from sysid.linear.plant import Frame
from sysid.profile import Problem

Array = NDArray[np.float64]

WIDE = 0.25
"""Relative standard deviation beyond which a symmetric interval is not to be believed."""


def wide(estimate: Estimate) -> list[tuple[str, float, float]]:
    """(name, low, high) of every derived number but the bias whose standard deviation exceeds ``WIDE``, at 95 %."""
    frame, values = estimate.plant
    derived = plants.derived(frame, values)
    sds = np.sqrt(np.diag(plants.propagate(frame, values, estimate.covariance)))
    problem = Problem(*estimate.objective, estimate.lowest, estimate.highest)
    found = []
    for i, name in enumerate(plants.derived_names(frame.plane)[:-1]):
        if sds[i] > WIDE * abs(derived[i]):
            ends = profile.interval(problem, values, _derived(frame, i), float(sds[i]))
            found.append((name, *ends))
    return found


def _derived(frame: Frame, index: int) -> Callable[[Array], float]:
    return lambda values: float(plants.derived(frame, values)[index])
