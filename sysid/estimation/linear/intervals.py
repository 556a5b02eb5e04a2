"""Intervals of what a plane's estimate leaves wide, by profile likelihood."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sysid.estimation import profile_likelihood
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.estimate import PlaneEstimate
from sysid.estimation.linear.linear_model import LinearModelStructure
from sysid.estimation.profile_likelihood import LeastSquaresEstimate

Array = NDArray[np.float64]

WIDE_RELATIVE_SD = 0.25
"""Relative standard deviation beyond which a symmetric interval is not to be believed."""


def wide_intervals(estimate: PlaneEstimate) -> list[tuple[str, float, float]]:
    """(name, low, high) of every derived number but the bias whose standard deviation exceeds
    ``WIDE_RELATIVE_SD``, at 95 %."""
    frame, values = estimate.plant
    derived = plants.derived(frame, values)
    sds = np.sqrt(np.diag(plants.propagate(frame, values, estimate.covariance)))
    problem = LeastSquaresEstimate(*estimate.objective, estimate.lowest, estimate.highest)
    found = []
    for i, name in enumerate(plants.derived_names(frame.plane)[:-1]):
        if sds[i] > WIDE_RELATIVE_SD * abs(derived[i]):
            ends = profile_likelihood.interval(problem, values, _derived(frame, i), float(sds[i]))
            found.append((name, *ends))
    return found


def _derived(frame: LinearModelStructure, index: int) -> Callable[[Array], float]:
    return lambda values: float(plants.derived(frame, values)[index])
