"""Search for the minimum of a cost function from several starts, and checks that it is unique."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from mavlink_io.errors import ErrorCode, OperationError
from sysid.estimation.linear import linear_model
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import LinearPrior
from sysid.estimation.map.convergence import START_COST_TOLERANCE, SearchCosts

Array = NDArray[np.float64]

STARTS = 8
"""Number of further starts."""
FINE_TOLERANCE = 1e-7
"""Relative cost change that ends a search.

About 0.001 standard deviations for a thousand samples.
"""
COARSE_TOLERANCE = 1e-4
"""Relative cost change that ends a search whose end is only compared."""
MAX_EVALUATIONS = 60
"""Maximum number of evaluations of a search."""
SINGULAR_EIGENVALUE = 1e-10
"""Smallest eigenvalue of the information, scaled to a unit diagonal.

Below it rounding dominates.
"""
BOUND_TOLERANCE = 1e-3
"""Distance from a bound, as a share of the range, below which a value counts as at the bound."""


DELAY = "delay_s"
"""Name of the delay among the values."""


class NotUniqueError(OperationError):
    """The data do not determine one plane.

    The message names the value or the starts, and a remedy.
    """

    code = ErrorCode.NOT_UNIQUE


class SearchResult(NamedTuple):
    """End of a search."""

    values: Array
    cost: float
    evaluations: int


def search(
    objective: Objective,
    prior: LinearPrior,
    start: Array,
    ftol: float = FINE_TOLERANCE,
) -> SearchResult:
    """Minimise the objective within the prior's bounds.

    Parameters
    ----------
    objective : Objective
        Residuals and Jacobian.
    prior : LinearPrior
        Bounds and scales.
    start : ndarray, (p,)
        Initial values.
    ftol : float
        Relative cost change that ends the search.

    Returns
    -------
    SearchResult
        Values, cost and number of evaluations.

    Notes
    -----
    Nonlinear least squares by the trust region reflective method (Branch et al. 1999).
    """
    scale, margin = prior.spread, 1e-6 * (prior.highest - prior.lowest)
    solution = least_squares(
        lambda u: objective.residuals(scale * u),
        np.clip(start, prior.lowest + margin, prior.highest - margin) / scale,
        jac=lambda u: objective.jacobian(scale * u) * scale,
        bounds=(prior.lowest / scale, prior.highest / scale),
        ftol=ftol,
        xtol=1e-6,
        max_nfev=MAX_EVALUATIONS,
    )
    return SearchResult(scale * solution.x, float(solution.cost), int(solution.nfev))


def sample_starts(prior: LinearPrior, count: int = STARTS) -> list[Array]:
    """Sample starts from the prior, the same on every machine."""
    generator = np.random.default_rng(4154)
    scale = prior.spread
    root = np.linalg.cholesky(prior.covariance / np.outer(scale, scale) + 1e-9 * np.eye(scale.size))
    margin = 0.05 * (prior.highest - prior.lowest)
    samples = prior.model.values + scale * (generator.standard_normal((count, scale.size)) @ root.T)
    return [np.clip(sample, prior.lowest + margin, prior.highest - margin) for sample in samples]


def search_from_starts(
    objective: Objective, prior: LinearPrior, best: SearchResult, count: int
) -> tuple[SearchResult, list[float]]:
    """Return the best of ``best`` and of searches from other starts, and the costs of the latter.

    An end with a larger cost is searched on, because it may have stopped early in a flat valley.
    """
    ends = [
        search(objective, prior, start, COARSE_TOLERANCE) for start in sample_starts(prior, count)
    ]
    lowest = min([best, *ends], key=lambda end: end.cost)
    ends = [
        search(objective, prior, end.values)
        if end.cost > lowest.cost * (1.0 + START_COST_TOLERANCE)
        else end
        for end in ends
    ]
    lowest = min([best, *ends], key=lambda end: end.cost)
    if lowest.cost < best.cost * (1.0 - START_COST_TOLERANCE):
        best = search(objective, prior, lowest.values)
    return best, [end.cost for end in ends]


def uniqueness_failures(
    objective: Objective, prior: LinearPrior, best: SearchResult, costs: Sequence[float]
) -> tuple[str, ...]:
    """Return the reasons why the minimum is not unique; empty for a unique one.

    The costs of the starts differ, or a value is at a bound. A delay of zero is a result, not a
    bound.

    Raises
    ------
    NotUniqueError
        The information is singular, so that there is no covariance.
    """
    plane, names = prior.model.frame.plane, linear_model.names(prior.model.frame.plane)
    weakest = weakest_direction(information_at(objective, best.values))
    if weakest.eigenvalue < SINGULAR_EIGENVALUE:
        names_text = ", ".join(names[i] for i in weakest.values)
        raise NotUniqueError(
            f"{plane}: the tests do not distinguish {names_text}; record richer ones"
            " (3-2-1-1, doublets)"
        )
    failures = []
    ranges = prior.highest - prior.lowest
    for name, value, low, high in zip(names, best.values, prior.lowest, prior.highest, strict=True):
        if name == DELAY and is_delay_zero(prior, best.values):
            continue
        if min(value - low, high - value) < BOUND_TOLERANCE * ranges[names.index(name)]:
            failures.append(
                f"{plane}: {name} = {value:.4g} is at its bound, {low:.4g} to {high:.4g}"
            )
    ends = SearchCosts(best.cost, costs)
    if not ends.is_unique:
        failures.append(f"{plane}: {ends.description}: the tests allow more than one model")
    return tuple(failures)


def is_delay_zero(prior: LinearPrior, values: Array) -> bool:
    """Return whether the delay ended at its lower bound of zero."""
    i = linear_model.names(prior.model.frame.plane).index(DELAY)
    distance = values[i] - prior.lowest[i]
    span = prior.highest[i] - prior.lowest[i]
    return bool(prior.lowest[i] == 0.0 and distance < BOUND_TOLERANCE * span)


class WeakestDirection(NamedTuple):
    """Combination of values about which the data contain least information."""

    eigenvalue: float
    values: tuple[int, ...]
    """Indices of the values with a large component."""


def weakest_direction(information: Array) -> WeakestDirection:
    """Return the weakest direction of the information, scaled to a unit diagonal."""
    scale = np.sqrt(np.diag(information))
    undetermined = np.flatnonzero(scale == 0.0)
    if undetermined.size:
        return WeakestDirection(0.0, tuple(undetermined.tolist()))
    eigenvalues, directions = np.linalg.eigh(information / np.outer(scale, scale))
    return WeakestDirection(
        float(eigenvalues[0]), tuple(np.flatnonzero(np.abs(directions[:, 0]) > 0.3).tolist())
    )


def information_at(objective: Objective, values: Array) -> Array:
    """Return the information J'J of an objective at ``values``, (p, p)."""
    J = objective.jacobian(values)
    information: Array = J.T @ J
    return information
