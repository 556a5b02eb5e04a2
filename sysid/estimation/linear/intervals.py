"""Profile-likelihood intervals of the numbers of a linear estimate with a large relative sd."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sysid.estimation import profile_likelihood
from sysid.estimation.linear import linear_model
from sysid.estimation.linear.estimate import PlaneEstimate
from sysid.estimation.linear.linear_model import LinearModelStructure
from sysid.estimation.profile_likelihood import LeastSquaresEstimate

Array = NDArray[np.float64]

WIDE_RELATIVE_SD = 0.25
"""Relative standard deviation above which a symmetric interval is not valid."""


def wide_intervals(estimate: PlaneEstimate) -> list[tuple[str, float, float]]:
    """Return (name, low, high) at 95 % of the derived numbers with a large relative sd.

    The bias is left out. The limit is WIDE_RELATIVE_SD.
    """
    frame, values = estimate.model
    derived = linear_model.derived(frame, values)
    sds = np.sqrt(np.diag(linear_model.propagate(frame, values, estimate.covariance)))
    problem = LeastSquaresEstimate(*estimate.objective, estimate.lowest, estimate.highest)
    wide = []
    for i, name in enumerate(linear_model.derived_names(frame.plane)[:-1]):
        if sds[i] > WIDE_RELATIVE_SD * abs(derived[i]):
            interval = profile_likelihood.interval(
                problem, values, _derived(frame, i), float(sds[i])
            )
            wide.append((name, *interval))
    return wide


def _derived(frame: LinearModelStructure, index: int) -> Callable[[Array], float]:
    """Return a derived number as a function of the values."""
    return lambda values: float(linear_model.derived(frame, values)[index])
