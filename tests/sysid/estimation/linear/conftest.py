"""A linear vehicle of either plane, and tests of her."""

import math

import numpy as np
import pytest

from sysid.data.segments import Plane
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import records, response
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.records import LinearPrior, LinearRun
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_1_INITIAL
from tests.sysid import sea

TAIL = Actuator(0.3, 3.0, 0.6, math.radians(0.5), math.radians(15.0), math.radians(15.0))
TAIL_STEPS = {"delay_s": 2e-3, "natural_frequency_radps": 1e-3, "damping_ratio": 1e-4}
"""Of differences by the tailcone's values: its angle is nearly straight in each over so little."""


def plant(plane: Plane, adjusted: bool = True) -> LinearModel:
    """Table 1's plane, trimmed to half a degree."""
    column = TABLE_1_ADJUSTED if adjusted else TABLE_1_INITIAL
    linear = yaw_plane(column) if plane == "yaw" else pitch_plane(column)
    found = plants.of_plane(linear, TAIL, 1.3)
    values = found.values.copy()
    if plane == "pitch":
        values[-1] = math.radians(1.0)
    return LinearModel(found.frame, values)


def commands() -> list[SurfaceCommand]:
    """Six tests of unequal length, 3-2-1-1 and doublets both ways and steps."""
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


def flown(
    truth: LinearModel, told: list[SurfaceCommand], sds: np.ndarray, rng: np.random.Generator
) -> list[LinearRun]:
    """Runs under white noise of the sensors, each from a start and with a gyro bias of its own."""
    by, count = response.discretise(truth), plants.outputs(truth.frame.plane)
    runs = []
    for command in told:
        start = 0.02 * rng.standard_normal(len(by.transition))
        y = response.outputs(truth, by, command, start, count)
        y[:, 0] += 0.01 * rng.standard_normal()
        runs.append(LinearRun(command, y + sds[:count] * rng.standard_normal(y.shape)))
    return runs


def believed(plane: Plane) -> LinearPrior:
    """The paper's first column, a third unsure of everything, the lag measured."""
    first = plant(plane, adjusted=False)
    spread = np.maximum(0.35 * np.abs(first.values), 0.03)
    lag = plants.lag(plane)
    spread[lag] = plants.LAG_SD * first.values[lag]
    return records.with_bounds(first, np.diag(spread**2))


@pytest.fixture(params=["yaw", "pitch"])
def plane(request: pytest.FixtureRequest) -> Plane:
    return request.param
