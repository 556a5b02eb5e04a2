"""The fit's objective: whitened residuals of all runs and their sensitivities, beside what the
prior says."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig, VehicleFileError
from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.map import sensitivity
from sysid.estimation.map.datasets import Dataset, linear_plane
from sysid.estimation.map.sensitivity import Perturbation, Trajectory
from sysid.estimation.map.steady_state import cruise_speed_mps
from sysid.models import noise, parameters
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import PARAMETERS, CandidateVehicle

Array = NDArray[np.float64]

DIFFERENCE = 1e-4
"""Forward step of the sensitivities, in prior standard deviations."""
SPEED_PARAMETERS = ("axial_drag",)
"""Parameters that move the steady speed at a thrust."""


class Prior(NamedTuple):
    """Belief before the data: z is normal with ``mean`` and ``covariance``."""

    config: VehicleConfig
    biases_rad: dict[Plane, float]
    mean: Array
    covariance: Array


class MapProblem(NamedTuple):
    """What is to be explained, and under which noise."""

    prior: Prior
    experiments: Mapping[Plane, tuple[Dataset, ...]]
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


def vehicle(prior: Prior, z: Array) -> CandidateVehicle:
    return parameters.candidate_vehicle(prior.config, prior.biases_rad, z)


def filters(
    at: CandidateVehicle,
    experiments: Mapping[Plane, Sequence[Dataset]],
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


def cost(problem: MapProblem, z: Array) -> float:
    """Infinite where no such vehicle can be."""
    try:
        at = vehicle(problem.prior, z)
    except VehicleFileError:
        return math.inf
    left = sum(
        float(np.sum(white**2))
        for plane in problem.experiments
        for white in _whiten(problem, plane, _simulate(problem, at, plane))
    )
    away = z - problem.prior.mean
    return 0.5 * (left + float(away @ np.linalg.solve(problem.prior.covariance, away)))


def score(problem: MapProblem, z: Array) -> Score:
    """Cost, its slope by z, and the Gauss-Newton information of the data."""
    prior = problem.prior
    away = z - prior.mean
    pull = np.asarray(np.linalg.solve(prior.covariance, away), np.float64)
    slope: Array = pull
    total, information = float(away @ pull), np.zeros((z.size, z.size))
    for white, jacobian in linearise(problem, z):
        total += float(np.sum(white**2))
        slope = slope + jacobian.T @ white.ravel()
        information += jacobian.T @ jacobian
    return Score(0.5 * total, slope, information)


def linearise(problem: MapProblem, z: Array) -> Iterator[tuple[Array, Array]]:
    """Each run's whitened residuals (samples, outputs) and their slopes by z, plane by plane."""
    at = vehicle(problem.prior, z)
    moved = _perturbations(problem, at, z)
    for plane in problem.experiments:
        flown = _simulate(problem, at, plane)
        white, jacobians = (
            _whiten(problem, plane, flown),
            _jacobians(problem, plane, at, flown, moved),
        )
        yield from zip(white, jacobians, strict=True)


def _cruise_speeds_mps(problem: MapProblem, at: CandidateVehicle) -> dict[float, float]:
    thrusts = {float(e.run.thrust[0]) for group in problem.experiments.values() for e in group}
    return {thrust: cruise_speed_mps(at, thrust) for thrust in thrusts}


def _simulate(problem: MapProblem, at: CandidateVehicle, plane: Plane) -> list[Trajectory]:
    return sensitivity.simulate(
        at, plane, problem.experiments[plane], problem.stride, _cruise_speeds_mps(problem, at)
    )


def _outputs(plane: Plane) -> list[int]:
    """States that are measured: rate, angle, and in pitch depth; MAVLink counts all three the other
    way."""
    return [2, 3] if plane == "yaw" else [2, 3, 4]


def _whiten(problem: MapProblem, plane: Plane, flown: Sequence[Trajectory]) -> list[Array]:
    """(samples, outputs) of each run."""
    by = problem.filters[plane]
    found = []
    for what, flight in zip(problem.experiments[plane], flown, strict=True):
        simulated = -flight.track[:, _outputs(plane)]
        if plane == "pitch":
            simulated[:, 2] += what.start.depth_m + flight.first[4]
        found.append(noise.whiten_residual(what.measured - simulated, by))
    return found


def _jacobians(
    problem: MapProblem,
    plane: Plane,
    at: CandidateVehicle,
    flown: Sequence[Trajectory],
    moved: Sequence[Perturbation],
) -> list[Array]:
    """Of each run's whitened residuals by z, (samples x outputs, parameters)."""
    group, by = problem.experiments[plane], problem.filters[plane]
    used = [each for each in moved if plane in PARAMETERS[each.column].planes]
    packed = [each._replace(column=k) for k, each in enumerate(used)]
    found = []
    for by_z in sensitivity.sensitivities(
        at, plane, group, flown, packed, DIFFERENCE, problem.stride
    ):
        white = noise.whiten_columns(by_z[:, _outputs(plane)], by)
        jacobian = np.zeros((white.shape[0] * white.shape[1], len(PARAMETERS)))
        jacobian[:, [each.column for each in used]] = white.reshape(len(jacobian), -1)
        found.append(jacobian)
    return found


def _perturbations(problem: MapProblem, at: CandidateVehicle, z: Array) -> list[Perturbation]:
    """One candidate a step away for each parameter that the runs depend on."""
    prior, found = problem.prior, []
    for i in parameters.parameters_of_planes(list(problem.experiments)):
        beyond, part = z + DIFFERENCE * (np.arange(z.size) == i), PARAMETERS[i].part
        if part == "body":
            there = vehicle(prior, beyond)
        else:
            there = at._replace(
                actuators=parameters.actuators(prior.config, prior.biases_rad, beyond)
            )
        found.append(
            Perturbation(
                i,
                part,
                there,
                _cruise_speeds_mps(problem, there)
                if PARAMETERS[i].name in SPEED_PARAMETERS
                else {},
            )
        )
    return found
