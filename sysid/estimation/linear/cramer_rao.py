"""The Cramer-Rao bound: how well a set of tests could tell a plant, whoever estimates it.

The inverse of the information that the tests hold about the values, each run's own gyro bias and
starting state unknown (Ljung 1999, section 7.4). The lag's bench test counts as data."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import response
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models import noise
from sysid.models.noise import Noise

Array = NDArray[np.float64]


class Bound(NamedTuple):
    """Least covariances that an unbiased estimator can have."""

    information: Array
    """Of the values, (values, values), the bench's word on the lag included."""
    covariance: Array
    """Of the values, in the order of ``plant.names``."""
    derived: Array
    """Of gain, poles and the rest, in the order of ``plant.derived_names``."""


def bound_coloured(plant: LinearModel, commands: Sequence[SurfaceCommand], level: Noise) -> Bound:
    """Under the sea and the sensors of ``level``; starting states as uncertain as ``noise`` says.

    Args:
        plant: the truth, or a draw from what is believed of it.
        commands: of each test, its approach included.
        level: standard deviations of disturbance and sensors.

    Raises:
        ValueError: there is no test.
    """
    by, count = response.discretise(plant), plants.outputs(plant.frame.plane)
    filtering = noise.build(plants.linear_plane(plant), level, response.DT, _max_steps(commands))
    information = bench_information(plant)
    for command in commands:
        slopes = response.slopes(
            plant, by, response.duct_motion(plant, command), np.zeros(len(by.transition)), count
        )
        J = np.stack([noise.whiten_residual(slope, filtering).ravel() for slope in slopes])
        information += J @ J.T
    return of_information(plant, information)


def bound_white(plant: LinearModel, commands: Sequence[SurfaceCommand], level: Noise) -> Bound:
    """Under the sensors of ``level`` alone; starting states and gyro biases entirely unknown.

    Arguments and errors as ``bound_coloured``.
    """
    by, count = response.discretise(plant), plants.outputs(plant.frame.plane)
    sds, longest = sensor_sds(level)[:count], _max_steps(commands)
    unknown = response.nuisances(by, longest, count) / sds[:, None]
    information = bench_information(plant)
    for command in commands:
        steps = response.steps(command)
        Q = np.linalg.qr(unknown[:steps].reshape(steps * count, -1))[0]
        slopes = (
            response.slopes(
                plant, by, response.duct_motion(plant, command), np.zeros(len(by.transition)), count
            )
            / sds
        )
        J = slopes.reshape(len(slopes), -1)
        J -= (J @ Q) @ Q.T
        information += J @ J.T
    return of_information(plant, information)


def sensor_sds(level: Noise) -> Array:
    """Standard deviations of rate, angle and depth."""
    return np.array([level.rate_radps, level.angle_rad, level.depth_m])


def bench_information(plant: LinearModel) -> Array:
    """What the bench test of the tailcone tells of its lag, (values, values)."""
    lag = plants.lag(plant.frame.plane)
    information = np.zeros((plant.values.size, plant.values.size))
    information[lag, lag] = np.diag(1.0 / (plants.LAG_SD * plant.values[lag]) ** 2)
    return information


def of_information(plant: LinearModel, information: Array) -> Bound:
    """Inverted in units that make its diagonal one: values differ in size by powers of ten."""
    scale = 1.0 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    return Bound(information, covariance, plants.propagate(plant.frame, plant.values, covariance))


def _max_steps(commands: Sequence[SurfaceCommand]) -> int:
    if not commands:
        raise ValueError("a bound needs at least one test")
    return max(response.steps(command) for command in commands)
