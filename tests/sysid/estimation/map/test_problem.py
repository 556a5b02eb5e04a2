"""Cost of the joint fit: its derivatives, and evaluations that are used again."""

import math

import numpy as np
import pytest

from sitl.vehicle import config
from sysid import prior_knowledge
from sysid.data.runs import Run
from sysid.estimation.map import fit as joint
from sysid.estimation.map import problem as problems
from sysid.estimation.map.datasets import datasets_of, max_leads_s
from sysid.estimation.map.problem import MapProblem
from sysid.models import delta_method, parameters
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES
from sysid.planes import Plane


@pytest.fixture(scope="module")
def problem(campaign: list[Run], bench: config.VehicleConfig) -> MapProblem:
    runs = [campaign[0], campaign[-1]]
    prior = prior_knowledge.prior_of(runs, bench)
    first = problems.vehicle(prior, prior.mean)
    datasets = datasets_of(runs, first, max_leads_s(runs, first))
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


def test_score_with_known_linearisation_has_same_bits(problem: MapProblem) -> None:
    """The derivatives do not depend on the noise filters; those of the problem are used."""
    z = np.linspace(-0.3, 0.3, len(NAMES))
    filters = problems.filters(
        problems.vehicle(problem.prior, z), problem.datasets, problem.levels, problem.stride
    )
    other = problem._replace(filters=filters)
    linearisation = problems.score(problem, z).linearisation
    known = problems.score(other, z, linearisation)
    fresh = problems.score(other, z)
    assert known.cost == fresh.cost != problems.cost(problem, z)
    assert known.slope.tobytes() == fresh.slope.tobytes()
    assert known.information.tobytes() == fresh.information.tobytes()


@pytest.mark.parametrize("cost", [1e200, math.inf, math.nan])
def test_vehicle_whose_runs_diverge_is_impossible(
    cost: float, problem: MapProblem, campaign: list[Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    z = np.zeros(len(NAMES))
    evaluation = problems.evaluate(problem, z)
    assert evaluation is not None
    monkeypatch.setattr(problems, "_simulate_all", lambda *_: evaluation._replace(cost=cost))
    assert problems.evaluate(problem, z) is None
    assert problems.cost(problem, z) == math.inf
    with pytest.raises(config.VehicleFileError, match="its simulated tests diverge"):
        joint.fit(campaign[:1], problem.prior, starts=0)


@pytest.mark.parametrize(
    "name",
    [
        "Y_v",
        "N_r",
        "axial_drag",
        "natural_frequency",
        "delay_yaw",
        "crossflow_slope",
        "crossflow_uncoupled",
        "elevator_damping",
        "elevator_frequency",
        "angle_lag",
        "depth_lag",
    ],
)
def test_slope_of_cost_matches_central_difference(name: str, problem: MapProblem) -> None:
    """Tolerance: forward differences of 1e-4 sd, and linear inputs between rows (1 %)."""
    z, i = np.zeros(len(NAMES)), NAMES.index(name)
    step = 0.01 * (np.arange(len(NAMES)) == i)
    difference = (problems.cost(problem, z + step) - problems.cost(problem, z - step)) / 0.02
    slope = problems.score(problem, z).slope
    assert slope[i] == pytest.approx(difference, rel=0.03, abs=0.003 * np.abs(slope).max())


def forbid_beyond(name: str, limit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make vehicles impossible whose parameter is above a limit, in prior standard deviations."""
    index, build = NAMES.index(name), parameters._changed_config

    def changed_config(prior: config.VehicleConfig, z: np.ndarray) -> config.VehicleConfig:
        if z[index] > limit:
            raise config.VehicleFileError("the mass matrix has an eigenvalue -0.007")
        return build(prior, z)

    monkeypatch.setattr(parameters, "_changed_config", changed_config)


def test_score_at_edge_of_possible_vehicles_is_one_sided(
    problem: MapProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step beyond the edge ended the fit, so that --force had nothing to write.

    Tolerance: forward against backward differences of 1e-4 sd.
    """
    z = np.zeros(len(NAMES))
    inside = problems.score(problem, z).slope
    assert problems.at_edge(problem.prior, z) == ()
    forbid_beyond("N_v", 0.0, monkeypatch)
    assert problems.evaluate(problem, z + 0.1) is None
    edge = problems.score(problem, z).slope
    np.testing.assert_allclose(edge, inside, atol=0.01 * np.abs(inside).max())
    assert problems.at_edge(problem.prior, z) == ("N_v",)


def test_change_per_step_uses_the_possible_side() -> None:
    def quadratic(z: np.ndarray) -> np.ndarray:
        if z[0] > limit:
            raise config.VehicleFileError("impossible")
        return z**2

    z, step = np.array([1.0]), np.array([0.1])
    limit = 2.0
    assert delta_method.change_per_step(quadratic, z, step) == pytest.approx(0.2)
    limit = 1.0
    assert delta_method.change_per_step(quadratic, z, step) == pytest.approx(0.19)
    assert delta_method.change_per_step(quadratic, z, -step) == pytest.approx(-0.19)
    limit = 0.0
    with pytest.raises(config.VehicleFileError):
        delta_method.change_per_step(quadratic, z, step)
