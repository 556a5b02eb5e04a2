"""Profile intervals of the joint estimate: cost at their ends, and a generic constrained search."""

import math

import numpy as np
import pytest

from sitl.vehicle import config
from sysid.data.runs import Run
from sysid.estimation import profile_likelihood
from sysid.estimation.map import fit, intervals
from sysid.estimation.map import problem as problems
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.gauss_newton import Z_LIMIT
from sysid.estimation.map.problem import MapProblem, Prior
from sysid.models import delta_method, parameters
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import Plane
from sysid.prior_knowledge import prior_of


@pytest.fixture(scope="module")
def prior(campaign: list[Run], bench: config.VehicleConfig) -> Prior:
    return prior_of(campaign[:1], bench)


@pytest.fixture(scope="module")
def step_fit(campaign: list[Run], prior: Prior) -> Fit:
    """Fit of one short step, which hardly determines the slow pole."""
    return fit.fit(campaign[:1], prior, starts=0)


def test_wide_intervals_contain_the_estimate(step_fit: Fit, prior: Prior) -> None:
    by_name = {interval.name: interval for interval in intervals.wide_intervals(step_fit, prior)}
    assert "p_slow_per_s" in by_name
    assert "b1_per_s2" not in by_name
    pole = intervals._number(prior, Plane.YAW, "p_slow_per_s")(step_fit.z)
    assert by_name["p_slow_per_s"].low < pole < by_name["p_slow_per_s"].high
    assert str(by_name["p_slow_per_s"]).startswith("yaw: p_slow_per_s lies in ")


def test_wide_intervals_model_error_does_not_change_them(step_fit: Fit, prior: Prior) -> None:
    """A campaign of a plant from outside had an interval of 2.10 to 2.07 for a gain of 2.06."""
    widened = step_fit._replace(covariance=9.0 * step_fit.covariance)
    assert list(intervals.wide_intervals(widened, prior)) == list(
        intervals.wide_intervals(step_fit, prior)
    )


def test_interval_end_cost_grows_by_quantile(step_fit: Fit, prior: Prior) -> None:
    """A generic constrained search on the residuals finds no lower cost at the ends."""
    problem = intervals.problem_at_estimate(step_fit, prior)
    number = intervals._number(prior, Plane.YAW, "p_slow_per_s")
    least_cost = problems.cost(problem, step_fit.z)
    root = np.linalg.inv(np.linalg.cholesky(prior.covariance))

    def residuals(z: np.ndarray) -> np.ndarray:
        white = [w.ravel() for w, _ in problems.linearise(problem, z)]
        return np.concatenate([*white, root @ (z - prior.mean)])

    def jacobian(z: np.ndarray) -> np.ndarray:
        return np.vstack([*(j for _, j in problems.linearise(problem, z)), root])

    limits = np.full(len(NAMES), Z_LIMIT)
    generic = profile_likelihood.LeastSquaresEstimate(residuals, jacobian, -limits, limits)
    sd = math.sqrt(
        delta_method.slopes(number, step_fit.z)
        @ step_fit.covariance
        @ delta_method.slopes(number, step_fit.z)
    )
    for sign in (-1.0, 1.0):
        end, z = intervals.interval_end(problem, step_fit, number, sign)
        assert number(z) == pytest.approx(end)
        growth = problems.cost(problem, z) - least_cost
        assert growth == pytest.approx(0.5 * 1.96**2, rel=0.15)
        generic_z = profile_likelihood._constrained_optimum(generic, number, z, end, sd)
        assert problems.cost(problem, generic_z) > least_cost + 0.9 * growth


def test_interval_rich_data_matches_standard_deviation(campaign: list[Run], prior: Prior) -> None:
    """Example: b1, which every run determines."""
    rich = fit.fit(campaign[:7], prior, starts=0)
    number = intervals._number(prior, Plane.YAW, "b1_per_s2")
    slope = delta_method.slopes(number, rich.z)
    half = 1.96 * math.sqrt(slope @ rich.covariance @ slope)
    low, high = intervals.interval(intervals.problem_at_estimate(rich, prior), rich, number)
    assert high - low == pytest.approx(2 * half, rel=0.1)


def test_step_to_an_impossible_vehicle_ends_before_it() -> None:
    remus = config.load("remus100")
    prior = Prior(
        remus, dict.fromkeys(Plane, 0.0), np.zeros(len(NAMES)), parameters.prior_covariance()
    )
    z = np.array([4.0 if name == "z_CM" else 0.0 for name in NAMES])
    with pytest.raises(config.VehicleFileError):
        problems.vehicle(prior, z)
    problem = MapProblem(prior, {}, {}, {}, 1)
    found, evaluation = intervals.nearest_possible(problem, np.zeros(z.size), z)
    problems.vehicle(prior, found)
    assert evaluation is not None
    assert np.max(found) > 0.0
    again, _ = intervals.nearest_possible(problem, z, found)
    np.testing.assert_array_equal(again, found)


def test_step_to_a_vehicle_that_diverges_ends_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Derivatives of such runs overflowed, and the error was said to be one of the tests."""
    prior = Prior(
        config.load("remus100"), dict.fromkeys(Plane, 0.0), np.zeros(len(NAMES)), np.eye(len(NAMES))
    )
    simulate_all = problems._simulate_all

    def diverging(
        problem: MapProblem, candidate: CandidateVehicle, z: np.ndarray
    ) -> problems.Evaluation:
        evaluation = simulate_all(problem, candidate, z)
        return evaluation._replace(cost=math.nan if np.max(z) > 0.3 else 1.0)

    monkeypatch.setattr(problems, "_simulate_all", diverging)
    z = np.zeros(len(NAMES))
    z[NAMES.index("N_r")] = 1.0
    problem = MapProblem(prior, {}, {}, {}, 1)
    found, evaluation = intervals.nearest_possible(problem, np.zeros(z.size), z)
    assert np.max(found) == 0.25
    assert evaluation is not None
    assert evaluation.cost == 1.0
