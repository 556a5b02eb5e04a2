"""Profile likelihood: how far a derived quantity may be pulled before the data object.

Where a standard deviation is large, cost is no parabola and estimate plus or minus two of them is
no interval. The interval is then all values at which the least cost over everything else stays
within half the chi-square quantile of the estimate's (Venzon and Moolgavkar 1988)."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2

Array = NDArray[np.float64]

MAX_SD = 30.0
"""An end that lies farther than this is given up as infinite."""
STRIDE_GROWTH = 1.6
"""Of the stride in search of an end."""
CONSTRAINT_SD = 1e-3
"""Of a standard deviation: how firmly the quantity is held where it is pulled to."""
TOLERANCE_SD = 0.01


class LeastSquaresEstimate(NamedTuple):
    """A least-squares estimate: half the squared sum of residuals is the negative
    log-likelihood."""

    residuals: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]
    lowest: Array
    highest: Array


class ProfileInterval(NamedTuple):
    low: float
    """Minus infinity where the data set no end."""
    high: float


def interval(
    problem: LeastSquaresEstimate,
    best: Array,
    derived: Callable[[Array], float],
    sd: float,
    level: float = 0.95,
) -> ProfileInterval:
    """Values of ``derived`` that the data allow.

    Args:
        problem: the estimate, priors among its residuals if it has any.
        best: where its cost is least.
        derived: a smooth function of the parameters.
        sd: its standard deviation to first order, which scales the search.
        level: confidence.
    """
    allowed = 0.5 * float(chi2.ppf(level, 1))
    least = 0.5 * float(np.sum(problem.residuals(best) ** 2))
    centre = derived(best)

    def end(sign: float) -> float:
        track, excesses = {0.0: best}, {0.0: -allowed}

        def excess(away_sd: float) -> float:
            """Of the cost over what is allowed, the quantity held ``away_sd`` from the estimate.

            Once found it stands: a second search from where the first ended could end lower, and
            change its sign."""
            if away_sd not in excesses:
                nearest = min(track, key=lambda known: abs(known - away_sd))
                x = _constrained_optimum(
                    problem, derived, track[nearest], centre + sign * away_sd * sd, sd
                )
                track[away_sd] = x
                excesses[away_sd] = 0.5 * float(np.sum(problem.residuals(x) ** 2)) - least - allowed
            return excesses[away_sd]

        inside, outside = 0.0, 1.0
        while excess(outside) < 0.0:
            inside, outside = outside, STRIDE_GROWTH * outside
            if outside > MAX_SD:
                return sign * math.inf
        return centre + sign * sd * float(brentq(excess, inside, outside, xtol=TOLERANCE_SD))

    return ProfileInterval(end(-1.0), end(1.0))


def _constrained_optimum(
    problem: LeastSquaresEstimate,
    derived: Callable[[Array], float],
    start: Array,
    value: float,
    sd: float,
) -> Array:
    """Parameters of least cost with ``derived`` at ``value``."""
    scale = np.maximum(np.abs(start), 1e-3)

    def residuals(u: Array) -> Array:
        x = u * scale
        return np.append(problem.residuals(x), (derived(x) - value) / (CONSTRAINT_SD * sd))

    def jacobian(u: Array) -> Array:
        x = u * scale
        steps = np.diag(1e-6 * scale)
        slope = [(derived(x + h) - derived(x - h)) / (2.0 * np.max(h)) for h in steps]
        return np.vstack([problem.jacobian(x), np.array(slope) / (CONSTRAINT_SD * sd)]) * scale

    inside = 1e-9 * (problem.highest - problem.lowest)
    first = np.clip(start, problem.lowest + inside, problem.highest - inside)
    bounds = problem.lowest / scale, problem.highest / scale
    found = least_squares(
        residuals, first / scale, jac=jacobian, bounds=bounds, x_scale="jac", max_nfev=30
    )
    return np.asarray(found.x * scale)
