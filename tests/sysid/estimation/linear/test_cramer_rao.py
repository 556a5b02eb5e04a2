"""Cramer-Rao bound against the information from the full covariance of the outputs."""

import math

import numpy as np
import pytest

from sysid.estimation.linear import cramer_rao, linear_model, response
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.estimation.map.datasets import STEP_S
from sysid.models import noise
from sysid.models.noise import Noise
from sysid.planes import PLANES, Plane
from tests.sysid.estimation.linear.conftest import TAIL_STEPS, commands, true_model

LEVEL = Noise(rate_radps=math.radians(0.3), angle_rad=math.radians(0.3), depth_m=0.03)


def outputs(plane: Plane, values: np.ndarray, command: SurfaceCommand) -> np.ndarray:
    model = LinearModel(true_model(plane).frame, values)
    discrete = response.discretise(model)
    return response.outputs(
        model, discrete, command, np.zeros(len(discrete.transition)), PLANES[plane].n_outputs
    ).ravel()


def differences(plane: Plane, command: SurfaceCommand) -> np.ndarray:
    """(outputs, values) by central differences."""
    values = true_model(plane).values
    steps = [TAIL_STEPS.get(name, 1e-6) for name in linear_model.names(plane)]
    perturbations = [step * unit for step, unit in zip(steps, np.eye(values.size), strict=True)]
    columns = [
        (
            outputs(plane, values + perturbation, command)
            - outputs(plane, values - perturbation, command)
        )
        / (2 * step)
        for step, perturbation in zip(steps, perturbations, strict=True)
    ]
    return np.column_stack(columns)


def test_bound_coloured_matches_full_covariance(plane: Plane) -> None:
    """Reference: J' S^-1 J, with S the covariance of a short run's outputs from the noise model."""
    truth, command = true_model(plane), SurfaceCommand(commands()[0].angle_rad[:500])
    A, density, C, R, P = noise.system(linear_model.linear_plane(truth), LEVEL)
    Phi, Q = noise.discrete(A, density, STEP_S)
    steps, count = response.steps(command), len(C)
    covariances = [P]
    for _ in range(steps):
        covariances.append(Phi @ covariances[-1] @ Phi.T + Q)
    S = np.zeros((steps, count, steps, count))
    for i in range(steps):
        propagated = np.eye(len(A))
        for j in range(i, steps):
            S[j, :, i] = C @ propagated @ covariances[i] @ C.T
            S[i, :, j] = S[j, :, i].T
            propagated = Phi @ propagated
        S[i, :, i] += R
    J = differences(plane, command)
    dense = J.T @ np.linalg.solve(S.reshape(steps * count, -1), J) + cramer_rao.bench_information(
        truth
    )
    information = cramer_rao.bound_coloured(truth, [command], LEVEL).information
    scale = np.sqrt(np.diag(dense))
    np.testing.assert_allclose(
        information / np.outer(scale, scale), dense / np.outer(scale, scale), atol=2e-4
    )


def test_bound_white_matches_joint_information(plane: Plane) -> None:
    """Reference: block of the values in the inverse of the joint information with the nuisances."""
    truth, surface_commands = true_model(plane), commands()[:2]
    count = PLANES[plane].n_outputs
    discrete, sds = response.discretise(truth), cramer_rao.sensor_sds(LEVEL)[:count]
    information = np.zeros((0, 0))
    values = truth.values.size
    nuisance_count = len(discrete.transition) + 1
    information = np.zeros((values + 2 * nuisance_count, values + 2 * nuisance_count))
    information[:values, :values] = cramer_rao.bench_information(truth)
    for i, command in enumerate(surface_commands):
        steps = response.steps(command)
        J = np.zeros((steps * count, len(information)))
        J[:, :values] = differences(plane, command)
        J[:, values + i * nuisance_count : values + (i + 1) * nuisance_count] = response.nuisances(
            discrete, steps, count
        ).reshape(-1, nuisance_count)
        J /= np.tile(sds, steps)[:, None]
        information += J.T @ J
    expected = np.sqrt(np.diag(np.linalg.inv(information))[:values])
    sds_of_bound = np.sqrt(
        np.diag(cramer_rao.bound_white(truth, surface_commands, LEVEL).covariance)
    )
    np.testing.assert_allclose(sds_of_bound, expected, rtol=2e-3)


def test_bound_coloured_repeated_tests_double_information(plane: Plane) -> None:
    truth, surface_commands = true_model(plane), commands()
    once = cramer_rao.bound_coloured(truth, surface_commands, LEVEL)
    twice = cramer_rao.bound_coloured(truth, surface_commands * 2, LEVEL)
    bench = cramer_rao.bench_information(truth)
    np.testing.assert_allclose(
        twice.information - bench, 2.0 * (once.information - bench), rtol=1e-9, atol=1e-9
    )
    assert np.all(np.diag(twice.derived) < np.diag(once.derived))


def test_bound_white_without_tests_is_rejected() -> None:
    with pytest.raises(ValueError, match="at least one test"):
        cramer_rao.bound_white(true_model(Plane.YAW), [], LEVEL)
