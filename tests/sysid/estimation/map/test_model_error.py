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
    found = [model_error.scatter(drawn_scores(scatter, seed)) for seed in range(10)]
    assert np.mean(found) == pytest.approx(scatter, rel=0.15)


def test_noise_alone_gives_no_scatter() -> None:
    """5 % of campaigns may exceed the bound: at most 4 of 20 (99.7 %)."""
    found = [model_error.scatter(drawn_scores(0.0, seed)) for seed in range(20)]
    assert sum(value > 0.0 for value in found) <= 4


def test_score_has_information_and_gradient() -> None:
    rng = np.random.default_rng(1)
    white, jacobian = rng.standard_normal((7, 2)), rng.standard_normal((14, 3))
    score = model_error.score_of(white, jacobian)
    np.testing.assert_allclose(score.information, jacobian.T @ jacobian)
    np.testing.assert_allclose(score.slope, jacobian.T @ white.ravel())


def test_covariance_widens_delays_most() -> None:
    sds = dict(zip(NAMES, np.sqrt(np.diag(model_error.covariance(0.1))), strict=True))
    assert sds["N_dr"] == pytest.approx(0.3)
    assert sds["delay_yaw"] == pytest.approx(0.9)
    assert not model_error.covariance(0.0).any()
