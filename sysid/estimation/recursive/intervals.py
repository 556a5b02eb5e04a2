"""Estimate from the tests so far, with a covariance that covers errors of the model structure.

As the batch fit, by `model_error`. The information R_k z = d_k of test k, linearised about the
estimate at its time, has the gradient s_k = R_k' (R_k z - d_k) of its cost at the present estimate.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map import model_error
from sysid.estimation.recursive import square_root_information
from sysid.estimation.recursive.estimator import Knowledge, TestState

Array = NDArray[np.float64]


class Estimate(NamedTuple):
    """Estimate of the normalised parameters z."""

    z: Array
    """(p,), mean."""
    covariance: Array
    """(p, p), covariance."""


def estimate(knowledge: Knowledge, test: TestState | None = None) -> Estimate:
    """Return the estimate from the finished tests, and from the present one.

    Parameters
    ----------
    knowledge : Knowledge
        Prior and finished tests.
    test : TestState, optional
        State within the present test.

    Returns
    -------
    Estimate
        Mean and covariance of z.
    """
    prior, total = knowledge.prior, knowledge.information
    tests = [finished.information for finished in knowledge.tests]
    if test is not None and test.tracking is not None:
        tests.append(test.tracking.information)
        total = square_root_information.combine(total, test.tracking.information)
    if not tests:
        return Estimate(prior.mean, prior.covariance)
    z = square_root_information.mean(total)
    scores = [model_error.score_of(root @ z - rhs, root) for root, rhs in tests]
    data = np.sum([score.information for score in scores], axis=0)
    precision = np.asarray(np.linalg.inv(prior.covariance))
    conflict = model_error.prior_conflict(z - prior.mean, data, precision)
    scatter = model_error.scatter(scores).value
    return Estimate(z, model_error.covariance(data, precision, scatter, conflict))
