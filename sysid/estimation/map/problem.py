"""The fit's objective: whitened residuals of all runs and their sensitivities, beside what the
prior says."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig, VehicleError
from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.map import sensitivity
from sysid.estimation.map.datasets import Experiment, linear_plane
from sysid.estimation.map.sensitivity import Flight, Moved
from sysid.estimation.map.steady_state import cruise_speed_mps
from sysid.models import noise, parameters
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import PARAMETERS, Vehicle

Array = NDArray[np.float64]

DIFFERENCE = 1e-4
"""Forward step of the sensitivities, in prior standard deviations."""
CHANGES_SPEED = ("axial_drag",)
"""Parameters that move the steady speed at a thrust."""


class Prior(NamedTuple):
    """Belief before the data: z is normal with ``mean`` and ``covariance``."""

    config: VehicleConfig
    biases_rad: dict[Plane, float]
    mean: Array
    covariance: Array


class Problem(NamedTuple):
    """What is to be explained, and under which noise."""

    prior: Prior
    experiments: Mapping[Plane, tuple[Experiment, ...]]
    """Planes with runs only."""
    filters: Mapping[Plane, Filter]
    levels: Mapping[Plane, Noise]
    stride: int
    """Samples of the 50 Hz grid in a step; ``measured`` of the experiments has as many."""


class Score(NamedTuple):
    """Where a candidate stands."""

    cost: float
    """Half the sum of squares of whitened residuals and of the distance from the prior."""
    slope: Array
    information: Array
    """Of the data about z."""


def vehicle(prior: Prior, z: Array) -> Vehicle:
    return parameters.vehicle(prior.config, prior.biases_rad, z)


def filters(
    at: Vehicle,
    experiments: Mapping[Plane, Sequence[Experiment]],
    levels: Mapping[Plane, Noise],
    stride: int,
) -> dict[Plane, Filter]:
    """Noise filters of each plane, linearised about a candidate."""
    return {
        plane: noise.build(
            linear_plane(at, plane),
            levels[plane],
            stride / RATE_HZ,
            max(len(e.measured) for e in group),
        )
        for plane, group in experiments.items()
    }


def cost(problem: Problem, z: Array) -> float:
    """Infinite where no such vehicle can be."""
    try:
        at = vehicle(problem.prior, z)
    except VehicleError:
        return math.inf
    left = sum(
        float(np.sum(white**2))
        for plane in problem.experiments
        for white in _whitened(problem, plane, _fly(problem, at, plane))
    )
    away = z - problem.prior.mean
    return 0.5 * (left + float(away @ np.linalg.solve(problem.prior.covariance, away)))


def score(problem: Problem, z: Array) -> Score:
    """Cost, its slope by z, and the Gauss-Newton information of the data."""
    prior = problem.prior
    away = z - prior.mean
    pull = np.asarray(np.linalg.solve(prior.covariance, away), np.float64)
    slope: Array = pull
    total, information = float(away @ pull), np.zeros((z.size, z.size))
    for white, jacobian in linearised(problem, z):
        total += float(np.sum(white**2))
        slope = slope + jacobian.T @ white.ravel()
        information += jacobian.T @ jacobian
    return Score(0.5 * total, slope, information)


def linearised(problem: Problem, z: Array) -> Iterator[tuple[Array, Array]]:
    """Each run's whitened residuals (samples, outputs) and their slopes by z, plane by plane."""
    at = vehicle(problem.prior, z)
    moved = _moved(problem, at, z)
    for plane in problem.experiments:
        flown = _fly(problem, at, plane)
        white, jacobians = (
            _whitened(problem, plane, flown),
            _jacobians(problem, plane, at, flown, moved),
        )
        yield from zip(white, jacobians, strict=True)


def _speeds_mps(problem: Problem, at: Vehicle) -> dict[float, float]:
    thrusts = {float(e.run.thrust[0]) for group in problem.experiments.values() for e in group}
    return {thrust: cruise_speed_mps(at, thrust) for thrust in thrusts}


def _fly(problem: Problem, at: Vehicle, plane: Plane) -> list[Flight]:
    return sensitivity.flights(
        at, plane, problem.experiments[plane], problem.stride, _speeds_mps(problem, at)
    )


def _outputs(plane: Plane) -> list[int]:
    """States that are measured: rate, angle, and in pitch depth; MAVLink counts all three the other
    way."""
    return [2, 3] if plane == "yaw" else [2, 3, 4]


def _whitened(problem: Problem, plane: Plane, flown: Sequence[Flight]) -> list[Array]:
    """(samples, outputs) of each run."""
    by = problem.filters[plane]
    found = []
    for what, flight in zip(problem.experiments[plane], flown, strict=True):
        simulated = -flight.track[:, _outputs(plane)]
        if plane == "pitch":
            simulated[:, 2] += what.start.depth_m + flight.first[4]
        found.append(noise.whitened(what.measured - simulated, by))
    return found


def _jacobians(
    problem: Problem, plane: Plane, at: Vehicle, flown: Sequence[Flight], moved: Sequence[Moved]
) -> list[Array]:
    """Of each run's whitened residuals by z, (samples x outputs, parameters)."""
    group, by = problem.experiments[plane], problem.filters[plane]
    used = [each for each in moved if plane in PARAMETERS[each.column].planes]
    packed = [each._replace(column=k) for k, each in enumerate(used)]
    found = []
    for by_z in sensitivity.sensitivities(
        at, plane, group, flown, packed, DIFFERENCE, problem.stride
    ):
        white = noise.whitened_block(by_z[:, _outputs(plane)], by)
        jacobian = np.zeros((white.shape[0] * white.shape[1], len(PARAMETERS)))
        jacobian[:, [each.column for each in used]] = white.reshape(len(jacobian), -1)
        found.append(jacobian)
    return found


def _moved(problem: Problem, at: Vehicle, z: Array) -> list[Moved]:
    """One candidate a step away for each parameter that the runs depend on."""
    prior, found = problem.prior, []
    for i in parameters.of_planes(list(problem.experiments)):
        beyond, part = z + DIFFERENCE * (np.arange(z.size) == i), PARAMETERS[i].part
        if part == "body":
            there = vehicle(prior, beyond)
        else:
            there = at._replace(
                actuators=parameters.actuators(prior.config, prior.biases_rad, beyond)
            )
        found.append(
            Moved(
                i,
                part,
                there,
                _speeds_mps(problem, there) if PARAMETERS[i].name in CHANGES_SPEED else {},
            )
        )
    return found
