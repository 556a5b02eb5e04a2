"""The bound against the information of a covariance written out whole."""

import math

import numpy as np
import pytest

from sysid.data.segments import Plane
from sysid.estimation.linear import cramer_rao, response
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models import noise
from sysid.models.noise import Noise
from tests.sysid.estimation.linear.conftest import TAIL_STEPS, commands, plant

LEVEL = Noise(rate_radps=math.radians(0.3), angle_rad=math.radians(0.3), depth_m=0.03)


def outputs(plane: Plane, values: np.ndarray, command: SurfaceCommand) -> np.ndarray:
    at = LinearModel(plant(plane).frame, values)
    by = response.discretise(at)
    return response.outputs(
        at, by, command, np.zeros(len(by.transition)), plants.outputs(plane)
    ).ravel()


def differences(plane: Plane, command: SurfaceCommand) -> np.ndarray:
    """(outputs, values) by central differences."""
    values = plant(plane).values
    steps = [TAIL_STEPS.get(name, 1e-6) for name in plants.names(plane)]
    moves = [step * unit for step, unit in zip(steps, np.eye(values.size), strict=True)]
    columns = [
        (outputs(plane, values + move, command) - outputs(plane, values - move, command))
        / (2 * step)
        for step, move in zip(steps, moves, strict=True)
    ]
    return np.column_stack(columns)


def test_coloured_information_is_that_of_the_dense_covariance(plane: Plane) -> None:
    """J' S^-1 J with S the covariance of a short run's outputs, summed from the noise's own
    steps."""
    truth, command = plant(plane), SurfaceCommand(commands()[0].angle_rad[:500])
    A, density, C, R, P = noise.system(plants.linear_plane(truth), LEVEL)
    Phi, Q = noise.discrete(A, density, response.DT)
    steps, count = response.steps(command), len(C)
    covariances = [P]
    for _ in range(steps):
        covariances.append(Phi @ covariances[-1] @ Phi.T + Q)
    S = np.zeros((steps, count, steps, count))
    for i in range(steps):
        carried = np.eye(len(A))
        for j in range(i, steps):
            S[j, :, i] = C @ carried @ covariances[i] @ C.T
            S[i, :, j] = S[j, :, i].T
            carried = Phi @ carried
        S[i, :, i] += R
    J = differences(plane, command)
    dense = J.T @ np.linalg.solve(S.reshape(steps * count, -1), J) + cramer_rao.bench_information(
        truth
    )
    found = cramer_rao.bound_coloured(truth, [command], LEVEL).information
    size = np.sqrt(np.diag(dense))
    np.testing.assert_allclose(
        found / np.outer(size, size), dense / np.outer(size, size), atol=2e-4
    )


def test_white_information_leaves_nuisances_free(plane: Plane) -> None:
    """The values' block of the inverse of the joint information, nuisances beside them."""
    truth, told = plant(plane), commands()[:2]
    count = plants.outputs(plane)
    by, sds = response.discretise(truth), cramer_rao.sensor_sds(LEVEL)[:count]
    information = np.zeros((0, 0))
    values = truth.values.size
    each = len(by.transition) + 1
    information = np.zeros((values + 2 * each, values + 2 * each))
    information[:values, :values] = cramer_rao.bench_information(truth)
    for i, command in enumerate(told):
        steps = response.steps(command)
        J = np.zeros((steps * count, len(information)))
        J[:, :values] = differences(plane, command)
        J[:, values + i * each : values + (i + 1) * each] = response.nuisances(
            by, steps, count
        ).reshape(-1, each)
        J /= np.tile(sds, steps)[:, None]
        information += J.T @ J
    expected = np.sqrt(np.diag(np.linalg.inv(information))[:values])
    found = np.sqrt(np.diag(cramer_rao.bound_white(truth, told, LEVEL).covariance))
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def test_twice_the_tests_halve_the_variance_but_the_benchs(plane: Plane) -> None:
    truth, told = plant(plane), commands()
    once, twice = (
        cramer_rao.bound_coloured(truth, told, LEVEL),
        cramer_rao.bound_coloured(truth, told * 2, LEVEL),
    )
    bench = cramer_rao.bench_information(truth)
    np.testing.assert_allclose(
        twice.information - bench, 2.0 * (once.information - bench), rtol=1e-9, atol=1e-9
    )
    assert np.all(np.diag(twice.derived) < np.diag(once.derived))


def test_a_bound_needs_a_test() -> None:
    with pytest.raises(ValueError, match="at least one test"):
        cramer_rao.bound_white(plant("yaw"), [], LEVEL)
