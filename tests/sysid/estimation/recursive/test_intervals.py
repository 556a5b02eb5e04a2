"""Intervals of the live estimate cover errors of the model structure."""

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.vehicle import config
from sysid.estimation.map import model_error
from sysid.estimation.map.problem import Prior
from sysid.estimation.recursive import estimator, intervals, prediction, square_root_information
from sysid.estimation.recursive.estimator import FinishedTest, Knowledge
from sysid.models import parameters
from sysid.models.parameters import NAMES
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
SIZE = len(NAMES)


@pytest.fixture
def prior(bench: config.VehicleConfig) -> Prior:
    zeros: dict[Plane, float] = dict.fromkeys(PLANES, 0.0)
    return Prior(bench, zeros, np.zeros(SIZE), parameters.prior_covariance())


def informed(prior: Prior, optima: list[Array], sd: float) -> Knowledge:
    """Return the knowledge from tests that each see all parameters, with optima of their own."""
    knowledge = estimator.prior_knowledge(prior)
    tests = tuple(
        FinishedTest(
            Plane.YAW,
            prediction.empty_samples(Plane.YAW),
            square_root_information.from_normal(optimum, sd**2 * prior.covariance),
        )
        for optimum in optima
    )
    total = knowledge.information
    for test in tests:
        total = square_root_information.combine(total, test.information)
    return knowledge._replace(tests=tests, information=total)


def test_estimate_without_tests_is_the_prior(prior: Prior) -> None:
    estimate = intervals.estimate(estimator.prior_knowledge(prior))
    np.testing.assert_array_equal(estimate.z, prior.mean)
    np.testing.assert_array_equal(estimate.covariance, prior.covariance)


def test_estimate_of_equal_tests_has_the_covariance_of_the_data(prior: Prior) -> None:
    optimum = 0.5 * np.sqrt(np.diag(prior.covariance))
    estimate = intervals.estimate(informed(prior, [optimum] * 3, 0.3))
    share = 1.0 / (1.0 + 3.0 / 0.3**2)
    np.testing.assert_allclose(estimate.covariance, share * prior.covariance, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(estimate.z, (1.0 - share) * optimum, rtol=1e-6)


def test_estimate_of_tests_that_differ_is_wider_by_their_scatter(prior: Prior) -> None:
    """Optima of N(0, 0.5^2 P) and tests of 0.05 P: the scatter is 0.5, within its uncertainty."""
    rng = np.random.default_rng(1)
    root = np.linalg.cholesky(prior.covariance)
    optima = [root @ (0.5 * rng.standard_normal(SIZE)) for _ in range(6)]
    estimate = intervals.estimate(informed(prior, optima, 0.05))
    scatter = np.sqrt(np.diag(estimate.covariance) / np.diag(prior.covariance))
    np.testing.assert_allclose(scatter, 0.5, rtol=0.25)


def test_estimate_far_from_the_prior_is_wider_by_the_conflict(prior: Prior) -> None:
    """Tests that agree on four standard deviations in every parameter contradict the prior."""
    optimum = 4.0 * np.linalg.cholesky(prior.covariance) @ np.ones(SIZE)
    estimate = intervals.estimate(informed(prior, [optimum] * 3, 0.05))
    sds = np.sqrt(np.diag(estimate.covariance) / np.diag(prior.covariance))
    assert np.all(sds > 0.9 * model_error.COMMON)
    np.testing.assert_allclose(estimate.z, optimum, rtol=0.01)
