"""The search for the most likely candidate: Gauss-Newton steps, damped where the vehicle is not
what they take it for.

Levenberg (1944) and Marquardt (1963) in prior standard deviations, each held within bounds.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map import problem as problems
from sysid.estimation.map.problem import MapProblem, Score

Array = NDArray[np.float64]

Z_LIMIT = 4.0
"""Bounds, in prior standard deviations."""
MAX_STEPS = 60
INITIAL_DAMPING, DAMPING_INCREASE, DAMPING_DECREASE, MAX_DAMPING = 1e-3, 10.0, 0.1, 1e8


class SearchEnd(NamedTuple):
    z: Array
    score: Score
    steps: int


def descend(problem: MapProblem, start: Array, tolerance: float) -> SearchEnd:
    """From ``start`` until a step promises less than ``tolerance`` of the cost, or none lowers
    it."""
    z = np.clip(start, -Z_LIMIT, Z_LIMIT)
    here, damping, steps = problems.score(problem, z), INITIAL_DAMPING, 0
    precision = np.asarray(np.linalg.inv(problem.prior.covariance), np.float64)
    while steps < MAX_STEPS and damping < MAX_DAMPING:
        step, promised = _step(here, precision, z, damping)
        if promised <= tolerance * here.cost:
            break
        steps += 1
        there = z + step
        if problems.cost(problem, there) < here.cost:
            z, here, damping = there, problems.score(problem, there), damping * DAMPING_DECREASE
        else:
            damping *= DAMPING_INCREASE
    return SearchEnd(z, here, steps)


def _step(here: Score, precision: Array, z: Array, damping: float) -> tuple[Array, float]:
    """A damped step within the bounds and the fall of the cost that it promises.

    Parameters that stand at a bound and are pushed against it sit the step out.
    """
    curvature = here.information + precision
    free = ~((np.abs(z) >= Z_LIMIT) & (here.slope * z < 0.0))
    damped = curvature + damping * np.diag(np.diag(curvature))
    step = np.zeros(z.size)
    step[free] = -np.linalg.solve(damped[np.ix_(free, free)], here.slope[free])
    step = np.clip(z + step, -Z_LIMIT, Z_LIMIT) - z
    return step, -float(here.slope @ step + 0.5 * step @ curvature @ step)
