"""Cost of the joint fit: its derivatives, and evaluations that are used again."""

import numpy as np
import pytest

from sitl.vehicle import config
from sysid import refit
from sysid.data.segments import Run
from sysid.estimation.map import fit as joint
from sysid.estimation.map import problem as problems
from sysid.estimation.map.problem import MapProblem
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES
from sysid.planes import Plane


@pytest.fixture(scope="module")
def problem(campaign: list[Run], bench: config.VehicleConfig) -> MapProblem:
    runs = [campaign[0], campaign[-1]]
    prior = refit.prior_of(runs, bench)
    datasets = joint._datasets(runs, problems.vehicle(prior, prior.mean))
    assert set(datasets) == set(Plane)
    return joint._problem(prior, datasets, {plane: Noise() for plane in datasets}, prior.mean)


def test_score_with_known_evaluation_has_same_bits(problem: MapProblem) -> None:
    z = np.linspace(-0.3, 0.3, len(NAMES))
    evaluation = problems.evaluate(problem, z)
    assert evaluation is not None
    assert evaluation.cost == problems.cost(problem, z)
    known, fresh = problems.score(problem, z, evaluation), problems.score(problem, z)
    assert known.cost == fresh.cost
    assert known.slope.tobytes() == fresh.slope.tobytes()
    assert known.information.tobytes() == fresh.information.tobytes()


@pytest.mark.parametrize("name", ["Y_v", "N_r", "axial_drag", "natural_frequency", "delay_yaw"])
def test_slope_of_cost_matches_central_difference(name: str, problem: MapProblem) -> None:
    """Tolerance: forward differences of 1e-4 sd, and linear inputs between rows (1 %)."""
    z, i = np.zeros(len(NAMES)), NAMES.index(name)
    step = 0.01 * (np.arange(len(NAMES)) == i)
    difference = (problems.cost(problem, z + step) - problems.cost(problem, z - step)) / 0.02
    slope = problems.score(problem, z).slope
    assert slope[i] == pytest.approx(difference, rel=0.03, abs=0.003 * np.abs(slope).max())
