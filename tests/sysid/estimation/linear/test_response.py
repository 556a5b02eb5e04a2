"""The recursion against python-control, its slopes against differences."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import response
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models.linear_planes import small_signal
from tests.sysid.estimation.linear.conftest import TAIL_STEPS, commands, plant


def test_outputs_are_those_of_a_general_simulator(plane: Plane) -> None:
    """python-control's forced response joins its input by straight lines, as the recursion does."""
    truth, command = plant(plane), commands()[0]
    A, B = plants.equations(truth.frame, truth.values[: len(NUMBERS[plane])])
    n, count = len(A), plants.outputs(plane)
    system = control.ss(A, B[:, None], np.eye(n)[1 : 1 + count], np.zeros((count, 1)))
    angles = response.duct(truth, command)
    start = np.full(n, 0.02)
    expected = control.forced_response(
        system, np.arange(angles.size) / RATE_HZ, angles, start
    ).outputs.T[::5]
    expected[:, 1] += plants.level_rad(truth)
    found = response.outputs(truth, response.discretise(truth), command, start, count)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.ptp(found[:, 0]) > 0.02


def test_equations_have_the_planes_numbers(plane: Plane) -> None:
    """Yaw's canonical form answers as the physical plane that goes with it."""
    truth = plant(plane)
    physical = small_signal(plants.linear_plane(truth))
    np.testing.assert_allclose(plants.small_signal(truth), physical, rtol=1e-9)
    A, B = plants.equations(truth.frame, truth.values[: len(NUMBERS[plane])])
    linear = plants.linear_plane(truth)
    for s in (0.3j, 1.2j, 0.5 + 2.0j):
        expected = np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, linear.B)[1]
        assert np.linalg.solve(s * np.eye(len(A)) - A, B)[1] == pytest.approx(expected, rel=1e-9)


@settings(max_examples=25)
@given(
    plane=st.sampled_from(["yaw", "pitch"]),
    away=st.lists(st.floats(-0.6, 0.6), min_size=12, max_size=12),
    start=st.floats(-0.05, 0.05),
)
def test_slopes_are_those_of_the_outputs(plane: Plane, away: list[float], start: float) -> None:
    """Of any plane near Table 1's, unstable ones among them, and of its tailcone within its
    limits."""
    truth = plant(plane)
    numbers = len(NUMBERS[plane])
    values = truth.values.copy()
    values[:numbers] *= 1.0 + np.array(away[:numbers])
    values[numbers] = 0.311
    here, command = (
        LinearModel(truth.frame, values),
        SurfaceCommand(commands()[2].angle_rad, lead=30),
    )
    by, count = response.discretise(here), plants.outputs(plane)
    x0 = np.full(len(by.transition), start)
    slopes = response.slopes(here, by, response.duct_motion(here, command), x0, count)

    def outputs(index: int, step: float) -> np.ndarray:
        moved = values.copy()
        moved[index] += step
        at = LinearModel(truth.frame, moved)
        return response.outputs(at, response.discretise(at), command, x0, count)

    for index, name in enumerate(plants.names(plane)):
        step = TAIL_STEPS.get(name, 1e-5)
        expected = (outputs(index, step) - outputs(index, -step)) / (2.0 * step)
        np.testing.assert_allclose(
            slopes[index], expected, atol=2e-5 * np.max(np.abs(expected)), err_msg=name
        )
        assert np.max(np.abs(expected)) > 1e-6


def test_a_start_and_a_gyro_bias_add_what_the_nuisances_say(plane: Plane) -> None:
    truth, command = plant(plane), commands()[1]
    by, count = response.discretise(truth), plants.outputs(plane)
    n, steps = len(by.transition), response.steps(command)
    start = 0.01 * np.arange(1, n + 1)
    moved = response.outputs(truth, by, command, start, count)
    moved[:, 0] += 0.003
    at_rest = response.outputs(truth, by, command, np.zeros(n), count)
    added = response.nuisances(by, steps, count) @ np.append(start, 0.003)
    np.testing.assert_allclose(moved - at_rest, added, atol=1e-12)
