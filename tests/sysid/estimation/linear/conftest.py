"""Linear vehicle models of both planes, and simulated tests of them."""

import math

import numpy as np
import pytest

from sysid.estimation.linear import linear_model, records, response
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.records import LinearPrior, LinearRun
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import linear_plane
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_1_INITIAL
from tests.sysid import sea

TAIL = Actuator(0.3, 3.0, 0.6, math.radians(0.5), math.radians(15.0), math.radians(15.0))
TAIL_STEPS = {"delay_s": 2e-3, "natural_frequency_radps": 1e-3, "damping_ratio": 1e-4}
"""Difference steps of the tailcone's values; the duct angle is nearly linear over each."""


def true_model(plane: Plane, adjusted: bool = True) -> LinearModel:
    """Return the plane of the paper's Table 1 with an actuator bias of half a degree."""
    column = TABLE_1_ADJUSTED if adjusted else TABLE_1_INITIAL
    linear = linear_plane(plane, column)
    model = linear_model.of_plane(linear, TAIL, 1.3)
    values = model.values.copy()
    if linear_model.OFFSETS[plane]:
        values[-1] = math.radians(1.0)
    return LinearModel(model.frame, values)


def commands() -> list[SurfaceCommand]:
    """Return six tests of different length: 3-2-1-1 and doublets of both signs, and steps."""
    still = sea.step(0.0, 4.0)
    shapes = [
        np.concatenate(
            [
                sign * sea.step(share * 5.0, 1.5 * abs(share))
                for share in (3 / 3, -2 / 3, 1 / 3, -1 / 3)
            ]
        )
        for sign in (1.0, -1.0)
    ]
    shapes += [sign * sea.doublet(5.0, 3.0) for sign in (1.0, -1.0)] + [
        sea.step(4.0, 12.0),
        sea.step(-4.0, 12.0),
    ]
    return [SurfaceCommand(np.concatenate([still, shape, still])) for shape in shapes]


def simulate_runs(
    truth: LinearModel,
    surface_commands: list[SurfaceCommand],
    sds: np.ndarray,
    rng: np.random.Generator,
) -> list[LinearRun]:
    """Simulate runs with white sensor noise, random initial states and random gyro biases."""
    discrete, count = response.discretise(truth), PLANES[truth.frame.plane].n_outputs
    runs = []
    for command in surface_commands:
        start = 0.02 * rng.standard_normal(len(discrete.transition))
        outputs = response.outputs(truth, discrete, command, start, count)
        outputs[:, 0] += 0.01 * rng.standard_normal()
        runs.append(LinearRun(command, outputs + sds[:count] * rng.standard_normal(outputs.shape)))
    return runs


def wide_prior(plane: Plane) -> LinearPrior:
    """Return a prior from the paper's initial column: 35 % uncertainty, actuator lag measured."""
    mean = true_model(plane, adjusted=False)
    spread = np.maximum(0.35 * np.abs(mean.values), 0.03)
    lag = linear_model.lag(plane)
    spread[lag] = mean.frame.lag_relative_sd * mean.values[lag]
    return records.with_bounds(mean, np.diag(spread**2))


@pytest.fixture(params=["yaw", "pitch"])
def plane(request: pytest.FixtureRequest) -> Plane:
    return Plane(request.param)
