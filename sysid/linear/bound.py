"""The Cramer-Rao bound: how well a set of tests could tell a plant, whoever estimates it.

The inverse of the information that the tests hold about the values, each run's own gyro bias and starting state
unknown (Ljung 1999, section 7.4). The lag's bench test counts as data.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid import noise
from sysid.linear import plant as plants
from sysid.linear import response
from sysid.linear.plant import LAG_SD, NUMBERS, Plant
from sysid.linear.response import Discrete
from sysid.noise import Noise

Array = NDArray[np.float64]


class Bound(NamedTuple):
    """Least covariances that an unbiased estimator can have."""

    information: Array
    """Of the values, (values, values), the bench's word on the lag included."""
    covariance: Array
    """Of the values, in the order of ``plant.names``."""
    derived: Array
    """Of gain, poles and the rest, in the order of ``plant.derived_names``."""


def coloured(plant: Plant, commands_rad: Sequence[Array], level: Noise) -> Bound:
    """Under the sea and the sensors of ``level``; starting states as uncertain as ``noise`` says.

    Args:
        plant: the truth, or a draw from what is believed of it.
        commands_rad: command of each test on the 50 Hz grid, approach included.
        level: standard deviations of disturbance and sensors.

    Raises:
        ValueError: there is no test.
    """
    by, count = _discrete(plant), _count(plant)
    longest = max((steps(command) for command in commands_rad), default=0)
    if not longest:
        raise ValueError("a bound needs at least one test")
    filtering = noise.build(plants.linear_plane(plant), level, response.DT, longest)
    information = np.zeros((plant.values.size, plant.values.size))
    for command in commands_rad:
        slopes = response.slopes(plant, by, command, np.zeros(by.transition.shape[0]), count)
        J = np.stack([noise.whitened(slope, filtering).ravel() for slope in slopes])
        information += J @ J.T
    return of_information(plant, information + bench_information(plant))


def white(plant: Plant, commands_rad: Sequence[Array], level: Noise) -> Bound:
    """Under the sensors of ``level`` alone; starting states and gyro biases entirely unknown.

    Arguments and errors as ``coloured``.
    """
    by, count = _discrete(plant), _count(plant)
    if not commands_rad:
        raise ValueError("a bound needs at least one test")
    sds = sensors(level)[:count]
    information = np.zeros((plant.values.size, plant.values.size))
    for command in commands_rad:
        slopes = response.slopes(plant, by, command, np.zeros(by.transition.shape[0]), count) / sds
        Q = np.linalg.qr(nuisances(by, steps(command), count) / np.tile(sds, steps(command))[:, None])[0]
        J = slopes.reshape(len(slopes), -1).T
        J = J - Q @ (Q.T @ J)
        information += J.T @ J
    return of_information(plant, information + bench_information(plant))


def sensors(level: Noise) -> Array:
    """Standard deviations of rate, angle and depth."""
    return np.array([level.rate_radps, level.angle_rad, level.depth_m])


def nuisances(by: Discrete, steps: int, count: int) -> Array:
    """(steps * count, n + 1): what the starting state and the gyro's bias leave in one run's outputs."""
    gyro = np.zeros((steps, count, 1))
    gyro[:, 0] = 1.0
    return np.concatenate([response.free(by, steps, count), gyro], axis=2).reshape(steps * count, -1)


def steps(command_rad: Array) -> int:
    """Output steps of a run."""
    return (command_rad.size - 1) // response.STRIDE + 1


def bench_information(plant: Plant) -> Array:
    """What the bench test of the tailcone tells of its lag, (values, values)."""
    first = plants.names(plant.frame.plane).index("natural_frequency_radps")
    sds = np.array([LAG_SD["natural_frequency"], LAG_SD["damping_ratio"]]) * plant.values[first : first + 2]
    information = np.zeros((plant.values.size, plant.values.size))
    information[first, first], information[first + 1, first + 1] = 1.0 / sds**2
    return information


def of_information(plant: Plant, information: Array) -> Bound:
    """Inverted in units that make its diagonal one: values differ in size by powers of ten."""
    scale = 1.0 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    return Bound(information, covariance, plants.propagate(plant.frame, plant.values, covariance))


def _discrete(plant: Plant) -> Discrete:
    return response.discretise(plant.frame, plant.values[: len(NUMBERS[plant.frame.plane])])


def _count(plant: Plant) -> int:
    """Outputs: depth too in pitch."""
    return 3 if plant.frame.plane == "pitch" else 2
