"""Variable projection against joint least squares over values, initial states and biases."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from sysid.estimation.linear import (
    cramer_rao,
    linear_model,
    multistart,
    output_error,
    records,
    response,
)
from sysid.estimation.linear import objective as objectives
from sysid.estimation.linear.linear_model import LinearModel
from sysid.planes import PLANES, Plane
from tests.sysid.estimation.linear.conftest import commands, simulate_runs, true_model, wide_prior

SDS = np.array([math.radians(0.3), math.radians(0.3), 0.03])


def test_objective_matches_joint_least_squares(plane: Plane) -> None:
    """Reference: initial states and biases as further unknowns.

    Same estimate, cost and covariance.
    """
    truth, count = true_model(plane), PLANES[plane].n_outputs
    runs = simulate_runs(truth, commands()[:3], SDS, np.random.default_rng(1))
    prior, sds = wide_prior(plane), SDS[:count]
    projected = objectives.with_prior(output_error.objective(truth.frame, runs, sds), prior)
    projected_solution = multistart.search(projected, prior, prior.model.values, ftol=1e-12)
    nuisance_count, values = len(response.discretise(truth).transition) + 1, truth.values.size

    def joint(x: np.ndarray) -> np.ndarray:
        model = LinearModel(truth.frame, x[:values] * prior.spread)
        discrete = response.discretise(model)
        errors = []
        for i, run in enumerate(runs):
            nuisances = 0.01 * x[values + i * nuisance_count : values + (i + 1) * nuisance_count]
            outputs = response.outputs(model, discrete, run.command, nuisances[:-1], count)
            outputs[:, 0] += nuisances[-1]
            errors.append(((run.measured - outputs) / sds).ravel())
        lag, count_of_numbers = linear_model.lag(plane), len(linear_model.NUMBERS[plane])
        bench, offset = prior.model.values[lag], model.values - prior.model.values
        file_sds = records.COEFFICIENT_SD_FACTOR * prior.spread[:count_of_numbers]
        return np.concatenate(
            [
                *errors,
                offset[lag] / (prior.model.frame.lag_relative_sd * bench),
                offset[:count_of_numbers] / file_sds,
            ]
        )

    start = np.concatenate(
        [projected_solution.values / prior.spread + 0.02, np.zeros(nuisance_count * len(runs))]
    )
    joint_solution = least_squares(joint, start, ftol=1e-14, xtol=1e-14, gtol=1e-14, max_nfev=200)
    sd_joint = (
        np.sqrt(np.diag(np.linalg.inv(joint_solution.jac.T @ joint_solution.jac))[:values])
        * prior.spread
    )
    information = multistart.information_at(projected, projected_solution.values)
    sd = np.sqrt(
        np.diag(
            cramer_rao.of_information(
                LinearModel(truth.frame, projected_solution.values), information
            ).covariance
        )
    )
    assert abs(joint_solution.cost - projected_solution.cost) < 1e-4 * joint_solution.cost
    assert (
        np.max(np.abs(joint_solution.x[:values] * prior.spread - projected_solution.values) / sd)
        < 0.02
    )
    np.testing.assert_allclose(sd, sd_joint, rtol=0.02)


def test_objective_gradient_matches_differences(plane: Plane) -> None:
    """Kaufman's derivative omits a term that is orthogonal to the residual."""
    truth, count = true_model(plane), PLANES[plane].n_outputs
    runs = simulate_runs(truth, commands()[:3], SDS, np.random.default_rng(2))
    weighted = output_error.objective(truth.frame, runs, SDS[:count])
    values = wide_prior(plane).model.values
    gradient = weighted.jacobian(values).T @ weighted.residuals(values)
    for index in range(len(linear_model.NUMBERS[plane])):
        step = np.zeros(values.size)
        step[index] = 1e-6
        above, below = (
            0.5 * np.sum(weighted.residuals(z) ** 2) for z in (values + step, values - step)
        )
        assert abs((above - below) / 2e-6 - gradient[index]) < 1e-3 * np.max(
            np.abs(gradient[: index + 1])
        )


def test_reduce_by_qr_keeps_cost_gradient_and_information(plane: Plane) -> None:
    """A search uses only cost, gradient and information."""
    truth, count = true_model(plane), PLANES[plane].n_outputs
    runs = simulate_runs(truth, commands()[:5], SDS, np.random.default_rng(3))
    arguments = truth.frame, runs, SDS[:count]
    full, reduced = output_error.objective(*arguments), output_error.reduce_by_qr(*arguments)
    values = wide_prior(plane).model.values
    J, r = full.jacobian(values), full.residuals(values)
    A, b = reduced.jacobian(values), reduced.residuals(values)
    assert b.size == values.size + 1
    scale = np.sqrt(np.diag(J.T @ J))
    assert b @ b == pytest.approx(r @ r, rel=1e-9)
    np.testing.assert_allclose(
        A.T @ b / scale, J.T @ r / scale, rtol=1e-6, atol=1e-6 * float(np.linalg.norm(r))
    )
    np.testing.assert_allclose(
        A.T @ A / np.outer(scale, scale), J.T @ J / np.outer(scale, scale), atol=1e-9
    )
