"""Response of a linear plane against python-control, its derivatives against differences."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid.data.runs import RATE_HZ
from sysid.estimation.linear import linear_model, response
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models.linear_planes import small_signal
from sysid.planes import PLANES, Plane
from tests.sysid.estimation.linear.conftest import TAIL_STEPS, commands, true_model


def test_outputs_match_python_control(plane: Plane) -> None:
    """Reference: forced_response of python-control, which also interpolates its input linearly."""
    truth, command = true_model(plane), commands()[0]
    A, B = linear_model.equations(truth.frame, truth.values[: len(NUMBERS[plane])])
    n, count = len(A), PLANES[plane].n_outputs
    system = control.ss(A, B[:, None], np.eye(n)[1 : 1 + count], np.zeros((count, 1)))
    angles = response.duct(truth, command)
    start = np.full(n, 0.02)
    expected = control.forced_response(
        system, np.arange(angles.size) / RATE_HZ, angles, start
    ).outputs.T[::5]
    expected[:, 1] += linear_model.level_rad(truth)
    simulated = response.outputs(truth, response.discretise(truth), command, start, count)
    np.testing.assert_allclose(simulated, expected, atol=1e-9)
    assert np.ptp(simulated[:, 0]) > 0.02


def test_equations_match_physical_plane(plane: Plane) -> None:
    """The canonical form of yaw has the same response as the physical plane."""
    truth = true_model(plane)
    physical = small_signal(linear_model.linear_plane(truth))
    np.testing.assert_allclose(linear_model.small_signal(truth), physical, rtol=1e-9)
    A, B = linear_model.equations(truth.frame, truth.values[: len(NUMBERS[plane])])
    linear = linear_model.linear_plane(truth)
    for s in (0.3j, 1.2j, 0.5 + 2.0j):
        expected = np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, linear.B)[1]
        assert np.linalg.solve(s * np.eye(len(A)) - A, B)[1] == pytest.approx(expected, rel=1e-9)


@settings(max_examples=25)
@given(
    plane=st.sampled_from(["yaw", "pitch"]),
    away=st.lists(st.floats(-0.6, 0.6), min_size=12, max_size=12),
    start=st.floats(-0.05, 0.05),
)
def test_slopes_match_differences_of_outputs(plane: Plane, away: list[float], start: float) -> None:
    """Planes near Table 1, unstable ones included, and tailcones within their limits."""
    truth = true_model(plane)
    count_of_numbers = len(NUMBERS[plane])
    values = truth.values.copy()
    values[:count_of_numbers] *= 1.0 + np.array(away[:count_of_numbers])
    values[count_of_numbers] = 0.311
    model = LinearModel(truth.frame, values)
    command = SurfaceCommand(commands()[2].angle_rad, lead=30)
    discrete, count = response.discretise(model), PLANES[plane].n_outputs
    x0 = np.full(len(discrete.transition), start)
    slopes = response.slopes(model, discrete, response.duct_motion(model, command), x0, count)

    def outputs(index: int, step: float) -> np.ndarray:
        perturbed = values.copy()
        perturbed[index] += step
        perturbed_model = LinearModel(truth.frame, perturbed)
        return response.outputs(
            perturbed_model, response.discretise(perturbed_model), command, x0, count
        )

    for index, name in enumerate(linear_model.names(plane)):
        step = TAIL_STEPS.get(name, 1e-5)
        expected = (outputs(index, step) - outputs(index, -step)) / (2.0 * step)
        np.testing.assert_allclose(
            slopes[index], expected, atol=2e-5 * np.max(np.abs(expected)), err_msg=name
        )
        assert np.max(np.abs(expected)) > 1e-6


def test_nuisances_match_initial_state_and_gyro_bias(plane: Plane) -> None:
    truth, command = true_model(plane), commands()[1]
    discrete, count = response.discretise(truth), PLANES[plane].n_outputs
    n, steps = len(discrete.transition), response.steps(command)
    start = 0.01 * np.arange(1.0, n + 1)
    with_nuisances = response.outputs(truth, discrete, command, start, count)
    with_nuisances[:, 0] += 0.003
    at_rest = response.outputs(truth, discrete, command, np.zeros(n), count)
    effect = response.nuisances(discrete, steps, count) @ np.append(start, 0.003)
    np.testing.assert_allclose(with_nuisances - at_rest, effect, atol=1e-12)
