"""Noise filters linearised about the motion of a run."""

import numpy as np
import pytest

from sitl.vehicle import config
from sysid import prior_knowledge
from sysid.data.runs import Run
from sysid.estimation.map import fit
from sysid.estimation.map import problem as problems
from sysid.estimation.map.datasets import STEP_S, STRIDE, dataset, with_coupling_inputs
from sysid.estimation.map.manoeuvre_filters import manoeuvre_filters
from sysid.estimation.map.problem import MapProblem
from sysid.estimation.map.steady_state import linear_plane
from sysid.models import noise, parameters
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import Plane
from tests.sysid import sea


@pytest.fixture(scope="module")
def vehicle(bench: config.VehicleConfig) -> CandidateVehicle:
    return parameters.candidate_vehicle(bench, dict.fromkeys(Plane, 0.0), np.zeros(len(NAMES)))


def flown(bench: config.VehicleConfig, plane: Plane, degrees: float) -> Run:
    return sea.fly(bench, plane, sea.step(degrees, 15.0), level=sea.CALM)


@pytest.mark.parametrize("plane", list(Plane))
def test_manoeuvre_filters_straight_run_is_level_flight(
    bench: config.VehicleConfig, vehicle: CandidateVehicle, plane: Plane
) -> None:
    """Tolerance: pitch and heave are measured, with noise, or settle in the simulation."""
    data = with_coupling_inputs(vehicle, dataset(flown(bench, plane, 0.0)))
    (along,) = manoeuvre_filters(vehicle, {plane: [data]}, {plane: Noise()})[plane]
    level = noise.build(linear_plane(vehicle, plane), Noise(), STEP_S, len(data.measured))
    np.testing.assert_allclose(along.transitions[0], level.transitions[0], atol=2e-3)


def test_manoeuvre_filters_turn_damps_disturbances(
    bench: config.VehicleConfig, vehicle: CandidateVehicle
) -> None:
    """Crossflow drag damps the rate: its decay over a sample is faster in the turn."""
    data = dataset(flown(bench, Plane.YAW, 10.0))
    (along,) = manoeuvre_filters(vehicle, {Plane.YAW: [data]}, {Plane.YAW: Noise()})[Plane.YAW]
    straight, turning = along.transitions[0], along.transitions[-1]
    assert np.linalg.det(turning[:2, :2]) < 0.98 * np.linalg.det(straight[:2, :2])


def test_fit_minimises_cost_with_the_filters_of_its_runs(bench: config.VehicleConfig) -> None:
    """With the filter of level flight instead, the slope is far from zero at the estimate."""
    runs = [
        sea.fly(bench, Plane.YAW, sea.step(degrees, 15.0), seed=seed)
        for seed, degrees in enumerate((12.0, -12.0))
    ]
    prior = prior_knowledge.prior_of(runs, bench)
    estimate = fit.fit(runs, prior, starts=0)
    data, levels, z = estimate.datasets, estimate.noise, estimate.z
    last = fit.last_problem(prior, data, levels, z)
    level = last._replace(filters=problems.filters(estimate.vehicle, data, levels, STRIDE))

    def decrease(problem: MapProblem) -> float:
        """Decrease of the cost that the quadratic model at the estimate predicts."""
        score = problems.score(problem, z)
        curvature = score.information + np.linalg.inv(prior.covariance)
        return float(0.5 * score.slope @ np.linalg.solve(curvature, score.slope))

    assert decrease(last) < 0.05
    assert decrease(level) > 0.5
