"""Covariance of errors of the model structure: scatter between runs that is drawn and recovered."""

import numpy as np
import pytest

from sysid.estimation.map import model_error
from sysid.estimation.map.model_error import RunScore
from sysid.models import parameters
from sysid.models.parameters import NAMES

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


def test_covariance_contains_common_error_and_scatter() -> None:
    sds = np.sqrt(np.diag(model_error.structure_covariance(0.1)))
    np.testing.assert_allclose(sds, np.hypot(model_error.COMMON, 0.1), rtol=0.005)
    assert not model_error.structure_covariance(0.0).any()


def test_covariance_grows_continuously_with_the_scatter() -> None:
    """A scatter that is barely significant must not change the verdict on a model."""
    sds = [
        float(np.sqrt(model_error.structure_covariance(t)[0, 0]))
        for t in (0.0, 1e-4, 1e-3, 0.01, 0.1)
    ]
    assert sds == sorted(sds)
    assert sds[1] < 0.02 * sds[-1]
    assert sds[3] == pytest.approx(np.hypot(np.sqrt(0.5) * model_error.COMMON, 0.01))


def test_covariance_disperses_the_likelihood_with_the_scatter() -> None:
    """Without scatter that of the likelihood; with it the information counts a tenth."""
    precision = np.linalg.inv(parameters.prior_covariance())
    information = 1e6 * np.eye(len(precision))
    plain = np.sqrt(np.diag(model_error.covariance(information, precision, 0.0)))
    np.testing.assert_allclose(plain, 1e-3, rtol=1e-4)
    widened = model_error.covariance(information, precision, 1.0)
    widened -= model_error.structure_covariance(1.0)
    np.testing.assert_allclose(np.diag(widened), model_error.DISPERSION * 1e-6, rtol=1e-3)
