"""Damped Gauss-Newton search for the parameters with the largest posterior probability.

Symbols, in units of prior standard deviations: z parameters (p,), m and P prior mean and
covariance, g gradient of the cost, H = J'J the data's information from the whitened sensitivities J
(n, p), lambda damping. Cost and step (Levenberg 1944; Marquardt 1963)::

    cost(z) = 1/2 |e(z)|^2 + 1/2 (z - m)' P^-1 (z - m)
    A = H + P^-1
    (A + lambda diag(A)) dz = -g,    |z_i| <= Z_LIMIT, and no delay below zero

lambda decreases after a step that lowers the cost and increases after one that does not.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map import problem as problems
from sysid.estimation.map.problem import Evaluation, Linearisation, MapProblem, Prior, Score
from sysid.models import parameters
from sysid.models.parameters import NAMES

Array = NDArray[np.float64]

Z_LIMIT = 5.0
"""Bounds of the parameters, in prior standard deviations on both sides of zero (`lower_bounds`).

Sound campaigns of drawn plants end up to 4.7 away, where a parameter makes up for an error of the
structure; those with the file of another vehicle, whose redesign does not hold, beyond 5.
"""
MAX_STEPS = 60
"""Maximum number of steps, rejected ones included."""
INITIAL_DAMPING, DAMPING_INCREASE, DAMPING_DECREASE, MAX_DAMPING = 1e-3, 10.0, 0.1, 1e8
"""Damping lambda: initial value, factors after a rejected and an accepted step, final value."""
BASIN_SDS = 1.0
"""Distance from a known end, in its standard deviations, within which a search ends there too.

The linearised model that gives the standard deviations is valid in this range."""


class SearchEnd(NamedTuple):
    """Result of a search: parameters, cost with derivatives, and number of steps."""

    z: Array
    score: Score
    steps: int
    joined: int | None = None
    """Index of the known end at which the search stopped; None if it went to its own end."""


def descend(
    problem: MapProblem,
    start: Array,
    tolerance: float,
    known: Sequence[SearchEnd] = (),
    start_runs: Evaluation | Linearisation | None = None,
) -> SearchEnd:
    """Minimise the cost from ``start``.

    Parameters
    ----------
    problem : MapProblem
        Data, noise filters and prior.
    start : ndarray, (p,)
        Initial parameters, in prior standard deviations; clipped to the bounds.
    tolerance : float
        The search ends when the predicted decrease of a step is below this share of the cost.
    known : sequence of SearchEnd
        Ends of earlier searches of the same problem. A search that comes within ``BASIN_SDS`` of
        one of them stops.
    start_runs : Evaluation or Linearisation, optional
        Runs at ``start``, or runs and derivatives, if they are already known.

    Returns
    -------
    SearchEnd
        Parameters of the least cost found, or those of the known end that was reached.
    """
    lower, z = lower_bounds(problem.prior), within_bounds(problem.prior, start)
    precision = np.asarray(np.linalg.inv(problem.prior.covariance), np.float64)
    if (joined := _joined(known, precision, z, 0)) is not None:
        return joined
    current = problems.score(problem, z, start_runs)
    damping, steps = INITIAL_DAMPING, 0
    while steps < MAX_STEPS and damping < MAX_DAMPING:
        step, predicted_decrease, is_clipped = _step(current, precision, z, damping, lower)
        if predicted_decrease <= tolerance * current.cost:
            if not is_clipped:
                break
            damping *= DAMPING_INCREASE
            continue
        steps += 1
        candidate = z + step
        evaluation = problems.evaluate(problem, candidate)
        if evaluation and evaluation.cost < current.cost:
            # Before the derivatives: they take most of the time.
            if (joined := _joined(known, precision, candidate, steps)) is not None:
                return joined
            z = candidate
            current = problems.score(problem, candidate, evaluation)
            damping *= DAMPING_DECREASE
        else:
            damping *= DAMPING_INCREASE
    return SearchEnd(z, current, steps)


def lower_bounds(prior: Prior) -> Array:
    """Return the lower bounds of the parameters, in prior standard deviations.

    A delay ends at zero: with a bound below, the data would have no slope there, and every step
    would lead back to the prior.
    """
    bounds = np.full(len(NAMES), -Z_LIMIT)
    for index, zero in parameters.delays_of_zero(prior.config).items():
        bounds[index] = max(-Z_LIMIT, zero)
    return bounds


def within_bounds(prior: Prior, z: Array) -> Array:
    """Return parameters with those beyond a bound at this bound."""
    return np.clip(z, lower_bounds(prior), Z_LIMIT)


def is_free(current: Score, z: Array, lower: Array) -> NDArray[np.bool_]:
    """Return a mask of the parameters that the gradient does not push beyond their bounds."""
    outwards_above = (z >= Z_LIMIT) & (current.slope < 0.0)
    outwards_below = (z <= lower) & (current.slope > 0.0)
    return np.asarray(~(outwards_above | outwards_below))


def _joined(known: Sequence[SearchEnd], precision: Array, z: Array, steps: int) -> SearchEnd | None:
    """Return the known end near z with the steps to it; None if there is none.

    Distance in posterior standard deviations: sqrt((z - z_k)' (H_k + P^-1) (z - z_k)).
    """
    for index, end in enumerate(known):
        departure = z - end.z
        if departure @ (end.score.information + precision) @ departure < BASIN_SDS**2:
            return end._replace(steps=steps, joined=index)
    return None


def _step(
    current: Score, precision: Array, z: Array, damping: float, lower: Array
) -> tuple[Array, float, bool]:
    """Return a damped step within the bounds, its predicted decrease, and whether it is clipped.

    The decrease of the cost is -(g'dz + dz'A dz / 2). Parameters at a bound that the gradient
    pushes outwards are held fixed. A step that is clipped at a bound has another direction and may
    predict an increase far from a minimum: a shorter one does not reach the bound.
    """
    curvature = current.information + precision
    free = is_free(current, z, lower)
    damped = curvature + damping * np.diag(np.diag(curvature))
    step = np.zeros(z.size)
    step[free] = -np.linalg.solve(damped[np.ix_(free, free)], current.slope[free])
    within = np.clip(z + step, lower, Z_LIMIT) - z
    decrease = -float(current.slope @ within + 0.5 * within @ curvature @ within)
    is_clipped = np.any((z + step < lower) | (z + step > Z_LIMIT))
    return within, decrease, bool(is_clipped)
