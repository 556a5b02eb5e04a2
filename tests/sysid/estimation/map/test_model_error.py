"""Covariance of errors of the model structure: scatter and conflict, drawn and recovered."""

import numpy as np
import pytest
from numpy.typing import NDArray

from sysid.estimation.map import model_error
from sysid.estimation.map.model_error import RunScore
from sysid.models import parameters
from sysid.models.parameters import NAMES

Array = NDArray[np.float64]

RUNS = 24
"""Runs of the standard campaign."""


def drawn_scores(scatter: float, seed: int) -> list[RunScore]:
    """Return scores of runs that inform twelve directions each, 5 to 20 times as well as P0."""
    rng = np.random.default_rng(seed)
    p, prior_covariance = len(NAMES), parameters.prior_covariance()
    root = np.linalg.cholesky(prior_covariance)
    scores = []
    for _ in range(RUNS):
        J = rng.uniform(5.0, 20.0, (12, 1)) * rng.standard_normal((12, p)) / np.sqrt(p)
        deviation = scatter * root @ rng.standard_normal(p)
        scores.append(RunScore(J.T @ J, J.T @ (rng.standard_normal(12) + J @ deviation)))
    return scores


@pytest.mark.parametrize("scatter", [0.1, 0.3])
def test_scatter_is_recovered(scatter: float) -> None:
    """288 squares: the estimate scatters by 6 to 15 %; the mean of ten by less than 5 %."""
    found = [model_error.scatter(drawn_scores(scatter, seed)).value for seed in range(10)]
    assert np.mean(found) == pytest.approx(scatter, rel=0.15)


def test_noise_alone_gives_no_scatter() -> None:
    """5 % of campaigns may exceed the bound: at most 4 of 20 (99.7 %)."""
    found = [model_error.scatter(drawn_scores(0.0, seed)).value for seed in range(20)]
    assert sum(value > 0.0 for value in found) <= 4


def test_run_that_alone_deviates_is_named() -> None:
    scores = drawn_scores(0.0, 1)
    deviating = scores[7].information @ np.full(len(NAMES), 0.5)
    scores[7] = scores[7]._replace(slope=scores[7].slope + deviating)
    scatter = model_error.scatter(scores)
    assert scatter.value > 0.05
    assert (scatter.run, scatter.without_run) == (7, 0.0)


def test_score_has_information_and_gradient() -> None:
    rng = np.random.default_rng(1)
    white, jacobian = rng.standard_normal((7, 2)), rng.standard_normal((14, 3))
    score = model_error.score_of(white, jacobian)
    np.testing.assert_allclose(score.information, jacobian.T @ jacobian)
    np.testing.assert_allclose(score.slope, jacobian.T @ white.ravel())


PRECISION = np.asarray(np.linalg.inv(parameters.prior_covariance()), np.float64)
INFORMED = 1e6 * np.eye(len(NAMES))
"""Information that leaves nothing of the prior's uncertainty."""
INFORMED_HALF = np.diag(np.where(np.arange(len(NAMES)) % 2, 1e6, 0.0))


def offsets(size: float, seed: int) -> Array:
    """Return offsets from the prior mean, drawn from the prior and multiplied by ``size``."""
    draw = np.random.default_rng(seed).standard_normal(len(NAMES))
    return size * np.linalg.cholesky(parameters.prior_covariance()) @ draw


@pytest.mark.parametrize("information", [INFORMED, INFORMED_HALF])
def test_vehicles_near_their_file_do_not_contradict_the_prior(information: Array) -> None:
    """At 0.7 prior standard deviations Q exceeds E(Q) in 1 % or less of the draws."""
    estimate = np.linalg.solve(information + PRECISION, information)
    found = [
        model_error.prior_conflict(estimate @ offsets(0.7, seed), information, PRECISION)
        for seed in range(200)
    ]
    assert sum(value > 0.0 for value in found) <= 6


@pytest.mark.parametrize("size", [1.5, 3.0])
def test_conflict_is_the_share_beyond_the_prior(size: float) -> None:
    """Q / size^2 is chi-square of p, and E(1 / chi-square of p) = 1 / (p - 2).

    The mean of 1000 scatters by 0.004 at most; cutting at zero adds 0.002.
    """
    found = [
        model_error.prior_conflict(offsets(size, seed), INFORMED, PRECISION) for seed in range(1000)
    ]
    p = len(NAMES)
    assert np.mean(found) == pytest.approx(1.0 - size**-2 * p / (p - 2), abs=0.015)


def test_covariance_contains_common_error_and_scatter() -> None:
    sds = np.sqrt(np.diag(model_error.structure_covariance(0.1, 0.25)))
    np.testing.assert_allclose(sds, np.hypot(0.5 * model_error.COMMON, 0.1))
    assert not model_error.structure_covariance(0.0, 0.0).any()


def test_covariance_disperses_the_likelihood_with_the_conflict() -> None:
    """Without conflict the covariance is that of the likelihood."""
    plain = np.sqrt(np.diag(model_error.covariance(INFORMED, PRECISION, 0.0, 0.0)))
    np.testing.assert_allclose(plain, 1e-3, rtol=1e-4)
    widened = model_error.covariance(INFORMED, PRECISION, 0.1, 1.0)
    widened -= model_error.structure_covariance(0.1, 1.0)
    np.testing.assert_allclose(np.diag(widened), model_error.DISPERSION * 1e-6, rtol=1e-3)
