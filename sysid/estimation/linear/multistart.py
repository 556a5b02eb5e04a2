"""The least of an objective, sought from several places, and refused when it is not one place that
the data name."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import LinearPrior
from sysid.estimation.map.fit import START_COST_TOLERANCE

Array = NDArray[np.float64]

STARTS = 8
FINE_TOLERANCE = 1e-7
"""Relative cost change that ends a search: a thousandth of a standard deviation in a fit of some
thousand samples."""
COARSE_TOLERANCE = 1e-4
"""Relative cost change that ends a search whose end is only compared."""
SINGULAR_EIGENVALUE = 1e-10
"""Least eigenvalue of the information, scaled to a unit diagonal: below it rounding decides."""
BOUND_TOLERANCE = 1e-3
"""Share of the way between the bounds at which a value sits at one."""


class NotUniqueError(Exception):
    """The data do not name one plant; the message says which value or which starts, and what would
    help."""


class SearchResult(NamedTuple):
    values: Array
    cost: float
    evaluations: int


def search(
    objective: Objective,
    belief: LinearPrior,
    start: Array,
    ftol: float = FINE_TOLERANCE,
    most: int = 60,
) -> SearchResult:
    """Least squares from ``start`` within the belief's bounds (trust region reflective, Branch et
    al. 1999)."""
    scale, inside = belief.spread, 1e-6 * (belief.highest - belief.lowest)
    found = least_squares(
        lambda u: objective.residuals(scale * u),
        np.clip(start, belief.lowest + inside, belief.highest - inside) / scale,
        jac=lambda u: objective.jacobian(scale * u) * scale,
        bounds=(belief.lowest / scale, belief.highest / scale),
        ftol=ftol,
        xtol=1e-6,
        max_nfev=most,
    )
    return SearchResult(scale * found.x, float(found.cost), int(found.nfev))


def sample_starts(belief: LinearPrior, count: int = STARTS) -> list[Array]:
    """Draws from the belief, the same on every machine."""
    generator = np.random.default_rng(4154)
    scale = belief.spread
    root = np.linalg.cholesky(
        belief.covariance / np.outer(scale, scale) + 1e-9 * np.eye(scale.size)
    )
    inside = 0.05 * (belief.highest - belief.lowest)
    draws = belief.plant.values + scale * (generator.standard_normal((count, scale.size)) @ root.T)
    return [np.clip(draw, belief.lowest + inside, belief.highest - inside) for draw in draws]


def search_from_starts(
    objective: Objective, belief: LinearPrior, best: SearchResult, count: int
) -> tuple[SearchResult, list[float]]:
    """The best of ``best`` and of the searches from other starts, and the costs at which those
    ended.

    An end that disagrees is searched on from, in case it had only stopped early in a long valley.
    """
    ends = [
        search(objective, belief, start, COARSE_TOLERANCE) for start in sample_starts(belief, count)
    ]
    least = min([best, *ends], key=lambda end: end.cost)
    ends = [
        search(objective, belief, end.values)
        if end.cost > least.cost * (1.0 + START_COST_TOLERANCE)
        else end
        for end in ends
    ]
    least = min([best, *ends], key=lambda end: end.cost)
    if least.cost < best.cost * (1.0 - START_COST_TOLERANCE):
        best = search(objective, belief, least.values)
    return best, [end.cost for end in ends]


def require_unique(
    objective: Objective, belief: LinearPrior, best: SearchResult, costs: Sequence[float]
) -> None:
    """Refuse an end that is not one place.

    Raises:
        NotUniqueError: starts disagree in cost, a value sits at a bound, or the information is
        singular.
    """
    plane, names = belief.plant.frame.plane, plants.names(belief.plant.frame.plane)
    weak = weakest_direction(information_at(objective, best.values))
    if weak.eigenvalue < SINGULAR_EIGENVALUE:
        told = ", ".join(names[i] for i in weak.values)
        raise NotUniqueError(
            f"{plane}: the tests cannot tell {told} apart; record richer ones (3-2-1-1, doublets)"
        )
    reach = belief.highest - belief.lowest
    for name, value, low, high in zip(
        names, best.values, belief.lowest, belief.highest, strict=True
    ):
        if min(value - low, high - value) < BOUND_TOLERANCE * reach[names.index(name)]:
            raise NotUniqueError(
                f"{plane}: {name} = {value:.4g} sits at its bound, {low:.4g} to {high:.4g}"
            )
    worst = max(costs, default=best.cost)
    if worst > best.cost * (1.0 + START_COST_TOLERANCE):
        apart = sum(cost > best.cost * (1.0 + START_COST_TOLERANCE) for cost in costs)
        raise NotUniqueError(
            f"{plane}: {apart} of {len(costs)} starts ended up to {worst / best.cost - 1.0:.0%}"
            " above the least cost; the tests allow more than one plant"
        )


class WeakestDirection(NamedTuple):
    """The direction in which the information is least."""

    eigenvalue: float
    values: tuple[int, ...]
    """Indices of those that have a part in it."""


def weakest_direction(information: Array) -> WeakestDirection:
    """Of the information scaled to a unit diagonal, so that units do not decide."""
    size = np.sqrt(np.diag(information))
    blind = np.flatnonzero(size == 0.0)
    if blind.size:
        return WeakestDirection(0.0, tuple(blind.tolist()))
    eigenvalues, directions = np.linalg.eigh(information / np.outer(size, size))
    return WeakestDirection(
        float(eigenvalues[0]), tuple(np.flatnonzero(np.abs(directions[:, 0]) > 0.3).tolist())
    )


def information_at(objective: Objective, values: Array) -> Array:
    J = objective.jacobian(values)
    information: Array = J.T @ J
    return information
