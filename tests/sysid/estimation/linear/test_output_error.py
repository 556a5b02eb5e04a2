"""Variable projection against the joint least squares that it stands for."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from sysid.data.segments import Plane
from sysid.estimation.linear import cramer_rao, multistart, output_error, response
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import objective as objectives
from sysid.estimation.linear.linear_model import LinearModel
from tests.sysid.estimation.linear.conftest import believed, commands, flown, plant

SDS = np.array([math.radians(0.3), math.radians(0.3), 0.03])


def test_projection_equals_joint_least_squares(plane: Plane) -> None:
    """All starting states and biases as unknowns beside the values: same estimate, cost and
    covariance."""
    truth, count = plant(plane), plants.outputs(plane)
    runs = flown(truth, commands()[:3], SDS, np.random.default_rng(1))
    belief, sds = believed(plane), SDS[:count]
    projected = objectives.with_bench(output_error.objective(truth.frame, runs, sds), belief.model)
    found = multistart.search(projected, belief, belief.model.values, ftol=1e-12)
    each, values = len(response.discretise(truth).transition) + 1, truth.values.size

    def joint(x: np.ndarray) -> np.ndarray:
        at = LinearModel(truth.frame, x[:values] * belief.spread)
        by = response.discretise(at)
        errors = []
        for i, run in enumerate(runs):
            unknown = 0.01 * x[values + i * each : values + (i + 1) * each]
            y = response.outputs(at, by, run.command, unknown[:-1], count)
            y[:, 0] += unknown[-1]
            errors.append(((run.measured - y) / sds).ravel())
        lag = plants.lag(plane)
        bench = belief.model.values[lag]
        return np.concatenate([*errors, (at.values[lag] - bench) / (plants.LAG_SD * bench)])

    first = np.concatenate([found.values / belief.spread + 0.02, np.zeros(each * len(runs))])
    brute = least_squares(joint, first, ftol=1e-14, xtol=1e-14, gtol=1e-14, max_nfev=200)
    sd_joint = np.sqrt(np.diag(np.linalg.inv(brute.jac.T @ brute.jac))[:values]) * belief.spread
    information = multistart.information_at(projected, found.values)
    sd = np.sqrt(
        np.diag(
            cramer_rao.of_information(
                LinearModel(truth.frame, found.values), information
            ).covariance
        )
    )
    assert abs(brute.cost - found.cost) < 1e-4 * brute.cost
    assert np.max(np.abs(brute.x[:values] * belief.spread - found.values) / sd) < 0.02
    np.testing.assert_allclose(sd, sd_joint, rtol=0.02)


def test_gradient_is_the_projected_costs_own(plane: Plane) -> None:
    """Kaufman's slope leaves a term out that the residual does not see."""
    truth, count = plant(plane), plants.outputs(plane)
    runs = flown(truth, commands()[:3], SDS, np.random.default_rng(2))
    weighted = output_error.objective(truth.frame, runs, SDS[:count])
    values = believed(plane).model.values
    gradient = weighted.jacobian(values).T @ weighted.residuals(values)
    for index in range(len(plants.NUMBERS[plane])):
        step = np.zeros(values.size)
        step[index] = 1e-6
        rise = objectives.cost(weighted, values + step) - objectives.cost(weighted, values - step)
        assert abs(rise / 2e-6 - gradient[index]) < 1e-3 * np.max(np.abs(gradient[: index + 1]))


def test_reduced_has_the_cost_gradient_and_information_of_all_residuals(plane: Plane) -> None:
    """A search reads nothing else."""
    truth, count = plant(plane), plants.outputs(plane)
    runs = flown(truth, commands()[:5], SDS, np.random.default_rng(3))
    given = truth.frame, runs, SDS[:count]
    whole, few = output_error.objective(*given), output_error.reduce_by_qr(*given)
    values = believed(plane).model.values
    J, r = whole.jacobian(values), whole.residuals(values)
    A, b = few.jacobian(values), few.residuals(values)
    assert b.size == values.size + 1
    scale = np.sqrt(np.diag(J.T @ J))
    assert b @ b == pytest.approx(r @ r, rel=1e-9)
    np.testing.assert_allclose(
        A.T @ b / scale, J.T @ r / scale, rtol=1e-6, atol=1e-6 * np.linalg.norm(r)
    )
    np.testing.assert_allclose(
        A.T @ A / np.outer(scale, scale), J.T @ J / np.outer(scale, scale), atol=1e-9
    )
