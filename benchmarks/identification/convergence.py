"""Cell: whether the linear estimators reach the same minimum from any start as from the truth."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import linear_truth
from benchmarks.identification.linear_truth import Campaign
from benchmarks.study import Cell, Figure
from sysid.estimation.linear import estimate
from sysid.estimation.linear.estimate import Method, PlaneEstimate
from sysid.estimation.linear.linear_model import NUMBERS
from sysid.planes import Plane

Array = NDArray[np.float64]

ASTRAY = 0.3
"""Relative error of each parameter of the equation at the start, with random sign."""
SAME = 0.1
"""Largest distance of two minima, in standard deviations of the estimate per parameter."""
METHODS: dict[str, tuple[Method, linear_truth.Draw]] = {
    "output error, white": ("output-error", linear_truth.white),
    "filter error, coloured": ("filter-error", linear_truth.coloured),
}


def trial(vehicle: str, seed: int) -> list[float]:
    """Return 1.0 per method and start (prior, perturbed prior) that reaches the truth's minimum."""
    plane, row = tuple(Plane)[seed % len(Plane)], []
    for method, draw in METHODS.values():
        campaign = linear_truth.campaign(vehicle, plane, draw, seed)
        best = _from(campaign, method, campaign.truth.values)
        prior = campaign.belief.model.values
        astray = prior.copy()
        numbers = len(NUMBERS[plane])
        astray[:numbers] *= 1.0 + ASTRAY * np.random.default_rng([seed, 1]).choice(
            [-1.0, 1.0], numbers
        )
        row += [float(_same(best, _from(campaign, method, start))) for start in (prior, astray)]
    return row


def _from(campaign: Campaign, method: Method, start: Array) -> PlaneEstimate:
    """Return the estimate from a start."""
    return estimate.descend(campaign.records, campaign.belief, method, start)


def _same(first: PlaneEstimate, second: PlaneEstimate) -> bool:
    """Compare two estimates in the metric of the first one's covariance."""
    apart = second.model.values - first.model.values
    return bool(apart @ np.linalg.solve(first.covariance, apart) <= apart.size * SAME**2)


def judge(vehicle: str, rows: Array) -> Sequence[Figure]:
    """Return the fractions of runs that converge."""
    share = 100.0 * np.mean(rows, axis=0)
    figures = []
    for i, name in enumerate(METHODS):
        figures.append(
            Figure(
                f"{name}: converged from the prior's plane",
                float(share[2 * i]),
                lowest=100.0,
                unit="%",
            )
        )
        figures.append(
            Figure(f"{name}: from +-30 % of it", float(share[2 * i + 1]), lowest=99.0, unit="%")
        )
    return figures


CONVERGENCE = Cell("linear-convergence", "linear estimates from any start", trial, judge)
