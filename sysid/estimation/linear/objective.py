"""What an estimator makes small: residuals in units of their own noise, and their slopes by the
values."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.linear_model import LinearModel

Array = NDArray[np.float64]


class Objective(NamedTuple):
    residuals: Callable[[Array], Array]
    """Values to (n,); half their squared sum is the cost."""
    jacobian: Callable[[Array], Array]
    """Values to (n, values)."""


def with_bench(data: Objective, bench: LinearModel) -> Objective:
    """The same with the bench test of the tailcone as two more measurements, which ``bench``
    holds."""
    lag = plants.lag(bench.frame.plane)
    sds = plants.LAG_SD * bench.values[lag]
    slopes = np.zeros((2, bench.values.size))
    slopes[:, lag] = np.diag(1.0 / sds)

    def residuals(values: Array) -> Array:
        return np.concatenate([data.residuals(values), (values[lag] - bench.values[lag]) / sds])

    def jacobian(values: Array) -> Array:
        return np.vstack([data.jacobian(values), slopes])

    return Objective(residuals, jacobian)


def cost(objective: Objective, values: Array) -> float:
    return 0.5 * float(np.sum(objective.residuals(values) ** 2))
