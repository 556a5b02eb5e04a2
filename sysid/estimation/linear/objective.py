"""Cost function of an estimator: residuals in units of their noise, and their derivatives."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear.records import LinearPrior

Array = NDArray[np.float64]


class Objective(NamedTuple):
    """Least-squares cost function of p values."""

    residuals: Callable[[Array], Array]
    """Function from values (p,) to residuals (n,); half their squared sum is the cost."""
    jacobian: Callable[[Array], Array]
    """Function from values (p,) to derivatives of the residuals (n, p)."""


def with_prior(data: Objective, prior: LinearPrior) -> Objective:
    """Add the prior mean as a measurement with the standard deviations `measured_sds`."""
    weights = 1.0 / prior.measured_sds

    def residuals(values: Array) -> Array:
        return np.concatenate([data.residuals(values), weights * (values - prior.model.values)])

    def jacobian(values: Array) -> Array:
        return np.vstack([data.jacobian(values), np.diag(weights)])

    return Objective(residuals, jacobian)
