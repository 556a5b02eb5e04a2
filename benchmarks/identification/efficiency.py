"""Cells on linear vehicles: variance over the Cramer-Rao bound, and coverage of intervals.

The noise is white, coloured, or of a kind that the estimators do not model. Figures are averages
over the parameters that the tests identify: those whose bound is at most a quarter of the value,
and the bias. Two poles whose bounds overlap are left out together. For other parameters no
estimator has a meaningful standard deviation, and the tool reports profile likelihoods. Errors are
compared with the bound of tests and prior together.
"""

from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import baseline, linear_truth
from benchmarks.identification.linear_truth import Campaign, Draw
from benchmarks.study import Cell, Figure
from sysid.estimation.linear import cramer_rao, estimate, linear_model
from sysid.estimation.linear.cramer_rao import Bound
from sysid.estimation.linear.estimate import Method
from sysid.planes import Plane

Array = NDArray[np.float64]
Estimator = Callable[[Campaign], tuple[Array, Array]]
"""Return derived parameters and their covariance from a campaign."""

IDENTIFIABLE_SD = 0.25
"""Largest relative standard deviation of the bound for a parameter that counts as identifiable."""
WITHIN = 1.96
"""Half-width of a 95 % interval in standard deviations."""
DRAWS: dict[str, Draw] = {
    "white": linear_truth.white,
    "coloured": linear_truth.coloured,
    "misspecified": linear_truth.misspecified,
}


def _ours(campaign: Campaign, method: Method) -> tuple[Array, Array]:
    """Estimate with one of the methods of sysid."""
    found = estimate.descend(
        campaign.records, campaign.belief, method, campaign.belief.model.values
    )
    frame, values = found.model
    return linear_model.derived(frame, values), linear_model.propagate(
        frame, values, found.covariance
    )


def _theirs(campaign: Campaign) -> tuple[Array, Array]:
    """Estimate with the baseline."""
    return baseline.estimate(campaign.records, campaign.belief)


ESTIMATORS: dict[str, Estimator] = {
    "output error": partial(_ours, method="output-error"),
    "filter error": partial(_ours, method="filter-error"),
    "baseline": _theirs,
}


@cache
def bound(vehicle: str, plane: Plane, noise: str) -> Bound:
    """Return the bound of the tests alone; for unmodelled noise that of coloured noise."""
    truth, commands = linear_truth.true_plant(vehicle, plane), linear_truth.commands(vehicle, plane)
    if noise == "white":
        return cramer_rao.bound_white(truth, commands, linear_truth.WHITE)
    return cramer_rao.bound_coloured(truth, commands, linear_truth.COLOURED)


@cache
def bound_sds(vehicle: str, plane: Plane, noise: str) -> Array:
    """Return the bounds on standard deviations of tests and prior together."""
    sds = linear_truth.prior_belief(vehicle, plane).measured_sds
    sds[linear_model.lag(plane)] = np.inf  # the bench test is in the bound
    truth = linear_truth.true_plant(vehicle, plane)
    information = bound(vehicle, plane, noise).information + np.diag(sds**-2)
    return np.sqrt(np.diag(cramer_rao.of_information(truth, information).derived))


@cache
def identifiable(vehicle: str, plane: Plane, noise: str) -> NDArray[np.bool_]:
    """Return which derived parameters the tests identify; the bias always counts."""
    truth = linear_model.derived(*linear_truth.true_plant(vehicle, plane))
    sds = np.sqrt(np.diag(bound(vehicle, plane, noise).derived))
    mask = np.asarray(sds <= IDENTIFIABLE_SD * np.abs(truth))
    mask[-1] = True
    names = linear_model.derived_names(plane)
    fast, slow = names.index("p_fast_per_s"), names.index("p_slow_per_s")
    if abs(truth[fast] - truth[slow]) < WITHIN * (sds[fast] + sds[slow]):
        mask[[fast, slow]] = False
    return mask


def trial(vehicle: str, seed: int, noise: str, ways: Sequence[str]) -> list[float]:
    """Return errors in standard deviations of the bound and of the estimate, by way and plane."""
    row: list[float] = []
    campaigns = {
        plane: linear_truth.campaign(vehicle, plane, DRAWS[noise], seed) for plane in Plane
    }
    for way in ways:
        for plane, campaign in campaigns.items():
            mask = identifiable(vehicle, plane, noise)
            numbers, covariance = ESTIMATORS[way](campaign)
            error = numbers - linear_model.derived(*campaign.truth)
            row += (error / bound_sds(vehicle, plane, noise))[mask].tolist()
            row += (error / np.sqrt(np.diag(covariance)))[mask].tolist()
    return row


def judge(
    vehicle: str, rows: Array, noise: str, ways: Sequence[str], limits: Sequence[float]
) -> list[Figure]:
    """Return the figures of each estimator.

    ``limits`` are the targets of the first one: largest variance ratio, least and largest coverage.
    In white noise, filter error has no target: it always estimates some disturbance, which costs
    accuracy of gain and bias.
    """
    counts = [int(np.count_nonzero(identifiable(vehicle, plane, noise))) for plane in Plane]
    total = sum(len(linear_model.derived_names(plane)) for plane in Plane)
    figures = [Figure("parameters not identifiable, left out", float(total - sum(counts)))]
    shares, position = {}, 0
    for way in ways:
        errors, claimed = [], []
        for count in counts:
            errors.append(rows[:, position : position + count])
            claimed.append(rows[:, position + count : position + 2 * count])
            position += 2 * count
        shares[way] = np.mean(np.hstack(errors) ** 2, axis=0)
        covered = 100.0 * np.mean(np.abs(np.hstack(claimed)) < WITHIN, axis=0)
        figures += _figures(way, shares[way], covered, limits if way == ways[0] else NO_LIMITS)
    if "baseline" in shares:
        gain = np.sqrt(shares["baseline"] / shares[ways[0]])
        figures.append(
            Figure(f"baseline's error over {ways[0]}'s", float(np.exp(np.mean(np.log(gain)))))
        )
    return figures


NO_LIMITS = (np.inf, -np.inf, np.inf)


def _figures(way: str, ratios: Array, covered: Array, limits: Sequence[float]) -> list[Figure]:
    """Return the figures of one estimator."""
    most, lowest, highest = limits
    return [
        Figure(f"{way}: variance over bound", float(np.exp(np.mean(np.log(ratios)))), highest=most),
        Figure(f"{way}: variance over bound, largest", float(np.max(ratios))),
        Figure(f"{way}: coverage", float(np.mean(covered)), lowest, highest, "%"),
        Figure(f"{way}: coverage, least", float(np.min(covered)), unit="%"),
    ]


def _cell(
    name: str, about: str, noise: str, ways: Sequence[str], limits: Sequence[float], runs: int = 200
) -> Cell:
    """Return the cell of one kind of noise."""
    return Cell(
        name,
        about,
        partial(trial, noise=noise, ways=ways),
        partial(judge, noise=noise, ways=ways, limits=limits),
        runs,
    )


OURS = ("output error", "filter error")
CELLS = (
    _cell("linear-white", "sensor noise only", "white", OURS, (1.15, 92.0, 98.0)),
    _cell("linear-coloured", "modelled disturbances", "coloured", OURS[1:], (1.5, 92.0, 98.0)),
    _cell(
        "linear-misspecified",
        "waves and forces that are not modelled",
        "misspecified",
        OURS[1:],
        (np.inf, 90.0, np.inf),
    ),
    _cell(
        "linear-baseline",
        "common practice on the same data",
        "misspecified",
        ("filter error", "baseline"),
        NO_LIMITS,
        20,
    ),
)
