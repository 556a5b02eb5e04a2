"""Profile intervals of the joint estimate: the cost at their ends, and what a generic search makes
of the same."""

import math

import numpy as np
import pytest

from sitl.vehicle import build_model, config
from sysid.data.segments import Run
from sysid.estimation import profile_likelihood
from sysid.estimation.map import fit, intervals
from sysid.estimation.map import problem as problems
from sysid.estimation.map.fit import Fit, Prior
from sysid.estimation.map.gauss_newton import Z_LIMIT
from sysid.models import parameters
from sysid.models.parameters import NAMES


@pytest.fixture(scope="module")
def prior(campaign: list[Run], bench: config.VehicleConfig) -> Prior:
    biases = fit.trim_biases(bench, build_model.build(bench), campaign[:1])
    return Prior(bench, biases, np.zeros(len(NAMES)), parameters.prior_covariance())


@pytest.fixture(scope="module")
def found(campaign: list[Run], prior: Prior) -> Fit:
    """One short step tells little of the static gain."""
    return fit.fit(campaign[:1], prior, starts=0)


def test_what_one_step_leaves_wide_is_told_with_its_ends(found: Fit, prior: Prior) -> None:
    told = {each.name: each for each in intervals.wide_intervals(found, prior)}
    assert "static_gain_per_s" in told
    assert "b1_per_s2" not in told
    gain = intervals._number(prior, "yaw", "static_gain_per_s")(found.z)
    assert told["static_gain_per_s"].low < gain < told["static_gain_per_s"].high
    assert str(told["static_gain_per_s"]).startswith("yaw: static_gain_per_s lies in ")


def test_at_its_ends_the_least_cost_has_grown_by_the_quantile(found: Fit, prior: Prior) -> None:
    """And is the least: a generic constrained search on the residuals themselves ends no lower."""
    problem, number = (
        intervals.problem_at_estimate(found, prior),
        intervals._number(prior, "yaw", "static_gain_per_s"),
    )
    least = problems.cost(problem, found.z)
    root = np.linalg.inv(np.linalg.cholesky(prior.covariance))

    def residuals(z: np.ndarray) -> np.ndarray:
        white = [w.ravel() for w, _ in problems.linearise(problem, z)]
        return np.concatenate([*white, root @ (z - prior.mean)])

    def jacobian(z: np.ndarray) -> np.ndarray:
        return np.vstack([*(j for _, j in problems.linearise(problem, z)), root])

    limits = np.full(len(NAMES), Z_LIMIT)
    generic = profile_likelihood.LeastSquaresEstimate(residuals, jacobian, -limits, limits)
    sd = math.sqrt(
        intervals._slope(number, found.z) @ found.covariance @ intervals._slope(number, found.z)
    )
    for sign in (-1.0, 1.0):
        end, z = intervals.interval_end(problem, found, number, sign)
        assert number(z) == pytest.approx(end)
        grown = problems.cost(problem, z) - least
        assert grown == pytest.approx(0.5 * 1.96**2, rel=0.15)
        rival = profile_likelihood._constrained_optimum(generic, number, z, end, sd)
        assert problems.cost(problem, rival) > least + 0.9 * grown


def test_where_data_abound_the_profile_is_the_standard_deviation(
    campaign: list[Run], prior: Prior
) -> None:
    """Of b1, which every run tells."""
    rich = fit.fit(campaign[:7], prior, starts=0)
    number = intervals._number(prior, "yaw", "b1_per_s2")
    slope = intervals._slope(number, rich.z)
    half = 1.96 * math.sqrt(slope @ rich.covariance @ slope)
    low, high = intervals.interval(intervals.problem_at_estimate(rich, prior), rich, number)
    assert high - low == pytest.approx(2 * half, rel=0.1)
