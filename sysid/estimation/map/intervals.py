"""Profile-likelihood intervals of the design numbers whose standard deviation is large.

Venzon and Moolgavkar (1988): the number g(z) is held at a value, all parameters minimise the cost
under this constraint, and the interval ends where the least cost has grown by half the chi-square
quantile q::

    C(v) = min_z { cost(z) : g(z) = v },    2 (C(v) - cost(z0)) = q = (norm quantile)^2

The square root of the growth is nearly linear in v, so that a secant finds an end in a few searches
of a few Gauss-Newton steps each. `sysid.estimation.profile_likelihood` does the same for estimates
whose residuals are cheap to compute.

The likelihood accounts for sensors and sea, not for errors of the model structure. A number that
only these make uncertain (`model_error`) has no such interval: it would be narrower than the stated
standard deviation.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import compress, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from sysid.estimation.map import problem as problems
from sysid.estimation.map.fit import Fit, last_problem
from sysid.estimation.map.gauss_newton import Z_LIMIT, is_free, lower_bounds, within_bounds
from sysid.estimation.map.problem import Evaluation, MapProblem, Prior
from sysid.estimation.map.steady_state import linear_plane
from sysid.models import delta_method, linear_planes, parameters
from sysid.models.linear_planes import SmallSignal
from sysid.planes import Plane

Array = NDArray[np.float64]
Number = Callable[[Array], float]
Numbers = Callable[[Array], Array]

WIDE_RELATIVE_SD = 0.25
"""Relative standard deviation by the likelihood above which a symmetric interval is not valid."""
LEVEL = 0.95
"""Confidence level of the intervals."""
NUMBERS = ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s")
"""Design numbers that are tested, by their names in ``model.json``."""
SEARCHES, STEPS = 6, 4
"""Maximum number of secant searches for an end, and Gauss-Newton steps in each."""
QUANTILE_TOLERANCE = 0.03
"""Relative tolerance of the square root of the cost growth at an end."""
MAX_SD = 12.0
"""Distance from the estimate, in standard deviations, at which an end is reported as infinite."""
MAX_HALVINGS = 10
"""Maximum number of halvings of a step that leads to an impossible vehicle."""


class ParameterInterval(NamedTuple):
    """Interval of a design number at the confidence level of 95 %."""

    plane: Plane
    name: str
    low: float
    high: float
    """Infinite if the data do not limit the number."""

    def __str__(self) -> str:
        """Return the interval as text."""
        return (
            f"{self.plane}: {self.name} lies in {self.low:.3g} to {self.high:.3g} (95 %, profile"
            " likelihood)"
        )


def wide_intervals(estimate: Fit, prior: Prior) -> Iterator[ParameterInterval]:
    """Yield the intervals of all numbers whose relative sd by the likelihood is large."""
    numbers = _design_numbers(prior, tuple(estimate.datasets))
    slopes = delta_method.slopes(numbers, estimate.z)
    sds = delta_method.propagate_sd(slopes, _covariance(estimate, prior))
    is_wide = sds > WIDE_RELATIVE_SD * np.abs(numbers(estimate.z))
    if not is_wide.any():
        return
    problem = problem_at_estimate(estimate, prior)
    for plane, name in compress(product(estimate.datasets, NUMBERS), is_wide):
        low, high = interval(problem, estimate, _number(prior, plane, name))
        yield ParameterInterval(plane=plane, name=name, low=low, high=high)


def problem_at_estimate(estimate: Fit, prior: Prior) -> MapProblem:
    """Return the problem that the estimate minimises."""
    return last_problem(prior, estimate.datasets, estimate.noise, estimate.z)


def interval(problem: MapProblem, estimate: Fit, number: Number) -> tuple[float, float]:
    """Return the range of ``number``, a smooth function of z, that data and prior allow."""
    return interval_end(problem, estimate, number, -1.0).value, interval_end(
        problem, estimate, number, 1.0
    ).value


class IntervalEnd(NamedTuple):
    """End of a profile-likelihood interval."""

    value: float
    z: Array
    """(p,), parameters of least cost with the number at this value."""


def interval_end(problem: MapProblem, estimate: Fit, number: Number, sign: float) -> IntervalEnd:
    """Return the end below (``sign`` = -1) or above (``sign`` = 1) the estimate."""
    gradient, value = delta_method.slopes(number, estimate.z), number(estimate.z)
    covariance = _covariance(estimate, problem.prior)
    sd = math.sqrt(gradient @ covariance @ gradient)
    least_cost = problems.cost(problem, estimate.z)
    quantile = float(ndtri(0.5 + 0.5 * LEVEL))
    distance_sd, z = quantile, estimate.z + covariance @ gradient / sd * sign * quantile
    for _ in range(SEARCHES):
        z, _ = nearest_possible(problem, estimate.z, z)
        z = constrained_optimum(problem, number, z, value + sign * distance_sd * sd)
        root_growth = math.sqrt(max(0.0, 2.0 * (problems.cost(problem, z) - least_cost)))
        if (
            not math.isfinite(root_growth)
            or abs(root_growth - quantile) < QUANTILE_TOLERANCE * quantile
        ):
            break
        next_distance_sd = distance_sd * min(2.0, quantile / max(root_growth, 1e-9))
        z = estimate.z + (z - estimate.z) * next_distance_sd / distance_sd
        distance_sd = next_distance_sd
        if distance_sd > MAX_SD:
            return IntervalEnd(sign * math.inf, z)
    return IntervalEnd(number(z), z)


def constrained_optimum(problem: MapProblem, number: Number, start: Array, value: float) -> Array:
    """Minimise the cost with ``number`` at ``value``: Gauss-Newton with a Lagrange multiplier.

    A = J'J + P^-1, cost gradient g, number g_n(z) with gradient c; f = -A^-1 g is the free step::

        dz = f + A^-1 c (value - g_n(z) - c'f) / (c' A^-1 c)

    Parameters that the gradient pushes beyond their bounds are held fixed.
    """
    precision, lower = np.linalg.inv(problem.prior.covariance), lower_bounds(problem.prior)
    z = within_bounds(problem.prior, start)
    evaluation: Evaluation | None = None
    for _ in range(STEPS):
        current, gradient = problems.score(problem, z, evaluation), delta_method.slopes(number, z)
        free = np.flatnonzero(is_free(current, z, lower))
        inverse = np.zeros_like(precision)
        block = np.ix_(free, free)
        inverse[block] = np.linalg.inv((current.information + precision)[block])
        free_step = -inverse @ current.slope
        direction = inverse @ gradient
        step = free_step + direction * (value - number(z) - gradient @ free_step) / (
            gradient @ direction
        )
        changed = np.clip(z + np.clip(step, -1.0, 1.0), lower, Z_LIMIT)
        z, evaluation = nearest_possible(problem, z, changed)
    return np.asarray(z)


def nearest_possible(
    problem: MapProblem, possible: Array, z: Array
) -> tuple[Array, Evaluation | None]:
    """Return z, moved towards the parameters of a possible vehicle until its own is possible.

    An interval that reaches the edge of the possible vehicles ends there. The runs are those of z;
    None if z is ``possible``.
    """
    for _ in range(MAX_HALVINGS):
        evaluation = problems.evaluate(problem, z)
        if evaluation is not None:
            return z, evaluation
        z = 0.5 * (possible + z)
    return possible, None


def _covariance(estimate: Fit, prior: Prior) -> Array:
    """Return the covariance of z by data and prior, without that of the model structure."""
    information = estimate.data_information + np.linalg.inv(prior.covariance)
    return np.asarray(np.linalg.inv(information), np.float64)


def _design_numbers(prior: Prior, planes: Sequence[Plane]) -> Numbers:
    """Return the design numbers NUMBERS of planes, one plane after another, as a function of z."""
    indices = [SmallSignal._fields.index(name) for name in NUMBERS]

    def numbers(z: Array) -> Array:
        vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
        small_signals = [
            linear_planes.small_signal(linear_plane(vehicle, plane)) for plane in planes
        ]
        return np.array(small_signals)[:, indices].ravel()

    return numbers


def _number(prior: Prior, plane: Plane, name: str) -> Number:
    """Return one of the design numbers of a plane as a function of z."""
    numbers, index = _design_numbers(prior, (plane,)), NUMBERS.index(name)
    return lambda z: float(numbers(z)[index])
