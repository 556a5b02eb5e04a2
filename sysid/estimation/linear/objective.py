"""Cost function of an estimator: residuals in units of their noise, and their derivatives."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import linear_model
from sysid.estimation.linear.linear_model import LinearModel

Array = NDArray[np.float64]


class Objective(NamedTuple):
    """Least-squares cost function of p values."""

    residuals: Callable[[Array], Array]
    """Function from values (p,) to residuals (n,); half their squared sum is the cost."""
    jacobian: Callable[[Array], Array]
    """Function from values (p,) to derivatives of the residuals (n, p)."""


def with_bench(data: Objective, bench: LinearModel) -> Objective:
    """Add the tailcone's bench test as two measurements: frequency and damping of ``bench``."""
    lag = linear_model.lag(bench.frame.plane)
    sds = linear_model.LAG_SD * bench.values[lag]
    bench_jacobian = np.zeros((2, bench.values.size))
    bench_jacobian[:, lag] = np.diag(1.0 / sds)

    def residuals(values: Array) -> Array:
        return np.concatenate([data.residuals(values), (values[lag] - bench.values[lag]) / sds])

    def jacobian(values: Array) -> Array:
        return np.vstack([data.jacobian(values), bench_jacobian])

    return Objective(residuals, jacobian)
