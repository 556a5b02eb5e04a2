"""Intervals of the joint estimate's design numbers, where one standard deviation says too little.

A profile (Venzon and Moolgavkar 1988): the number is held away from its estimate, everything else
goes where the cost is least, and the interval ends where that cost has grown by half the chi-square
quantile. The square root of the growth is nearly linear in the number, so a secant finds the end in
a few searches, each a few Gauss-Newton steps under the constraint.
`sysid.estimation.profile_likelihood` does the same for estimates whose residuals cost little."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from sysid.data.segments import Plane
from sysid.estimation.map import problem as problems
from sysid.estimation.map.fit import STRIDE, Fit, linear_plane
from sysid.estimation.map.gauss_newton import Z_LIMIT
from sysid.estimation.map.problem import MapProblem, Prior
from sysid.models import linear_planes, parameters
from sysid.models.linear_planes import SmallSignal

Array = NDArray[np.float64]
Number = Callable[[Array], float]

WIDE_RELATIVE_SD = 0.25
"""Relative standard deviation beyond which a symmetric interval is not to be believed."""
LEVEL = 0.95
NUMBERS = ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s")
SEARCHES, STEPS = 6, 4
QUANTILE_TOLERANCE = 0.03
"""Of the quantile: an end this near is found."""
MAX_SD = 12.0
"""An end that lies farther than this is given up as infinite."""
DIFFERENCE = 1e-3


class ParameterInterval(NamedTuple):
    """At 95 %."""

    plane: Plane
    name: str
    low: float
    high: float
    """Infinite where the data set no end."""

    def __str__(self) -> str:
        return (
            f"{self.plane}: {self.name} lies in {self.low:.3g} to {self.high:.3g} (95 %, profile"
            " likelihood)"
        )


def wide_intervals(found: Fit, prior: Prior) -> Iterator[ParameterInterval]:
    """Of every number whose standard deviation exceeds ``WIDE_RELATIVE_SD`` of it, in the planes
    that have runs."""
    problem = problem_at_estimate(found, prior)
    for plane in found.experiments:
        for name in NUMBERS:
            number = _number(prior, plane, name)
            slope = _slope(number, found.z)
            sd, value = math.sqrt(slope @ found.covariance @ slope), number(found.z)
            if sd > WIDE_RELATIVE_SD * abs(value):
                low, high = interval(problem, found, number)
                yield ParameterInterval(plane, name, low, high)


def problem_at_estimate(found: Fit, prior: Prior) -> MapProblem:
    """The problem whose cost the estimate makes least."""
    by = problems.filters(problems.vehicle(prior, found.z), found.experiments, found.noise, STRIDE)
    return MapProblem(prior, found.experiments, by, found.noise, STRIDE)


def interval(problem: MapProblem, found: Fit, number: Number) -> tuple[float, float]:
    """Values of ``number``, a smooth function of z, that the data and the prior allow."""
    return interval_end(problem, found, number, -1.0).value, interval_end(
        problem, found, number, 1.0
    ).value


class IntervalEnd(NamedTuple):
    value: float
    z: Array
    """Where the cost is least with the number there."""


def interval_end(problem: MapProblem, found: Fit, number: Number, sign: float) -> IntervalEnd:
    """The one below the estimate (``sign`` -1) or the one above it (1)."""
    slope, value = _slope(number, found.z), number(found.z)
    sd, least = math.sqrt(slope @ found.covariance @ slope), problems.cost(problem, found.z)
    wanted = float(norm.ppf(0.5 + 0.5 * LEVEL))
    away, z = wanted, found.z + found.covariance @ slope / sd * sign * wanted
    for _ in range(SEARCHES):
        z = constrained_optimum(problem, number, z, value + sign * away * sd)
        grown = math.sqrt(max(0.0, 2.0 * (problems.cost(problem, z) - least)))
        if not math.isfinite(grown) or abs(grown - wanted) < QUANTILE_TOLERANCE * wanted:
            break
        further = away * min(2.0, wanted / max(grown, 1e-9))
        z, away = found.z + (z - found.z) * further / away, further
        if away > MAX_SD:
            return IntervalEnd(sign * math.inf, z)
    return IntervalEnd(number(z), z)


def constrained_optimum(problem: MapProblem, number: Number, start: Array, value: float) -> Array:
    """Where the cost is least with ``number`` at ``value``: Gauss-Newton with a Lagrange
    multiplier."""
    precision, z = np.linalg.inv(problem.prior.covariance), np.clip(start, -Z_LIMIT, Z_LIMIT)
    for _ in range(STEPS):
        here, along = problems.score(problem, z), _slope(number, z)
        inverse = np.linalg.inv(here.information + precision)
        free = -inverse @ here.slope
        pull = inverse @ along
        step = free + pull * (value - number(z) - along @ free) / (along @ pull)
        z = np.clip(z + np.clip(step, -1.0, 1.0), -Z_LIMIT, Z_LIMIT)
    return np.asarray(z)


def _number(prior: Prior, plane: Plane, name: str) -> Number:
    index = SmallSignal._fields.index(name)

    def number(z: Array) -> float:
        vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
        return float(linear_planes.small_signal(linear_plane(vehicle, plane))[index])

    return number


def _slope(number: Number, z: Array) -> Array:
    steps = DIFFERENCE * np.eye(z.size)
    return np.array([(number(z + h) - number(z - h)) / (2.0 * DIFFERENCE) for h in steps])
