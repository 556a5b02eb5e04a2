"""Profile-likelihood intervals of a quantity that is derived from a least-squares estimate.

With a large standard deviation the cost is not a parabola, and the estimate plus or minus two
standard deviations is no interval. With x the parameters, r(x) the residuals and g(x) the quantity,
the interval is (Venzon and Moolgavkar 1988)::

    C(v) = min_x { 1/2 |r(x)|^2 : g(x) = v },    C(v) - C(g(x0)) <= 1/2 chi2_quantile(level, 1)
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares
from scipy.special import chdtri

Array = NDArray[np.float64]

MAX_SD = 30.0
"""Distance from the estimate, in standard deviations, at which an end is reported as infinite."""
STRIDE_GROWTH = 1.6
"""Growth of the stride in the search for an end."""
CONSTRAINT_SD = 1e-3
"""Standard deviation of the constraint g(x) = v, relative to that of the quantity."""
TOLERANCE_SD = 0.01
"""Tolerance of an end, in standard deviations."""


class LeastSquaresEstimate(NamedTuple):
    """Least-squares problem.

    Half the squared sum of the residuals is the negative log-likelihood.
    """

    residuals: Callable[[Array], Array]
    """Function from parameters (p,) to residuals (n,)."""
    jacobian: Callable[[Array], Array]
    """Function from parameters (p,) to derivatives (n, p)."""
    lowest: Array
    """(p,), lower bounds of the parameters."""
    highest: Array
    """(p,), upper bounds of the parameters."""


class ProfileInterval(NamedTuple):
    """Interval of the derived quantity."""

    low: float
    """Minus infinity if the data do not limit it."""
    high: float


def interval(
    problem: LeastSquaresEstimate,
    best: Array,
    derived: Callable[[Array], float],
    sd: float,
    level: float = 0.95,
) -> ProfileInterval:
    """Return the values of ``derived`` that the data allow.

    Parameters
    ----------
    problem : LeastSquaresEstimate
        Residuals; priors are additional residuals.
    best : ndarray, (p,)
        Parameters of least cost.
    derived : callable
        Smooth function of the parameters.
    sd : float
        Its standard deviation to first order, which scales the search.
    level : float
        Confidence level.

    Returns
    -------
    ProfileInterval
        Ends of the interval, infinite beyond MAX_SD.
    """
    # An end is the root of C(v) - C(g(x0)) - 1/2 chi2 along v = g(x0) + sign d sd: d is bracketed
    # with a growing stride, then found by Brent's method.
    allowed_growth = 0.5 * float(chdtri(1, 1.0 - level))
    least_cost = 0.5 * float(np.sum(problem.residuals(best) ** 2))
    estimate = derived(best)

    def find_end(sign: float) -> float:
        """Return the end of the interval above (``sign`` 1) or below (-1) the estimate."""
        optima, excesses = {0.0: best}, {0.0: -allowed_growth}

        def excess(distance_sd: float) -> float:
            """Cost growth minus its limit, with the quantity ``distance_sd`` from the estimate.

            Values are stored. A second search from the end of the first could end lower and change
            the sign.
            """
            if distance_sd not in excesses:
                nearest_sd = min(optima, key=lambda known_sd: abs(known_sd - distance_sd))
                x = _constrained_optimum(
                    problem, derived, optima[nearest_sd], estimate + sign * distance_sd * sd, sd
                )
                optima[distance_sd] = x
                excesses[distance_sd] = (
                    0.5 * float(np.sum(problem.residuals(x) ** 2)) - least_cost - allowed_growth
                )
            return excesses[distance_sd]

        inside, outside = 0.0, 1.0
        while excess(outside) < 0.0:
            inside, outside = outside, STRIDE_GROWTH * outside
            if outside > MAX_SD:
                return sign * math.inf
        return estimate + sign * sd * float(brentq(excess, inside, outside, xtol=TOLERANCE_SD))

    return ProfileInterval(find_end(-1.0), find_end(1.0))


def _constrained_optimum(
    problem: LeastSquaresEstimate,
    derived: Callable[[Array], float],
    start: Array,
    value: float,
    sd: float,
) -> Array:
    """Parameters of least cost with ``derived`` held at ``value`` by an additional residual."""
    # Penalty in place of the constraint: min 1/2 |r(x)|^2 + 1/2 ((g(x) - v) / c)^2, with
    # c = CONSTRAINT_SD sd; the gradient of g by central differences.
    scale = np.maximum(np.abs(start), 1e-3)

    def residuals(scaled: Array) -> Array:
        x = scaled * scale
        return np.append(problem.residuals(x), (derived(x) - value) / (CONSTRAINT_SD * sd))

    def jacobian(scaled: Array) -> Array:
        """Return the slopes of the residuals and of the constraint by the scaled variables."""
        x = scaled * scale
        steps = np.diag(1e-6 * scale)
        gradient = [
            (derived(x + step) - derived(x - step)) / (2.0 * np.max(step)) for step in steps
        ]
        return np.vstack([problem.jacobian(x), np.array(gradient) / (CONSTRAINT_SD * sd)]) * scale

    inside = 1e-9 * (problem.highest - problem.lowest)
    first = np.clip(start, problem.lowest + inside, problem.highest - inside)
    bounds = problem.lowest / scale, problem.highest / scale
    solution = least_squares(
        residuals, first / scale, jac=jacobian, bounds=bounds, x_scale="jac", max_nfev=30
    )
    return np.asarray(solution.x * scale)
