"""Cost function of the joint fit.

Whitened residuals of all runs, their sensitivities, and the prior.

Symbols: z parameters in prior standard deviations (p,), m and P prior mean and covariance, e_k
whitened residual of run k (n_k,), J_k = d e_k / dz (n_k, p) (Jategaonkar 2015, ch. 4 and 5)::

    cost(z) = 1/2 sum_k |e_k|^2 + 1/2 (z - m)' P^-1 (z - m)
    slope = sum_k J_k' e_k + P^-1 (z - m)
    information = sum_k J_k' J_k
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import chain
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig, VehicleFileError
from sysid.data.runs import RATE_HZ
from sysid.estimation.map import model_error, sensitivity
from sysid.estimation.map.datasets import (
    Dataset,
    cruise_speeds_mps,
    depth_rate,
    with_sensor_lags,
)
from sysid.estimation.map.model_error import RunScore
from sysid.estimation.map.sensitivity import Perturbation, Trajectory
from sysid.estimation.map.steady_state import linear_plane
from sysid.models import noise, parameters
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import PARAMETERS, CandidateVehicle, Part
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

EDGE_STEP = 1e-3
"""Distance from z, in prior standard deviations, at which a vehicle may be impossible."""
DIFFERENCE = 1e-4
"""Forward difference step of the sensitivities, in prior standard deviations."""
DIVERGED_COST = 1e12
"""Cost above which simulated runs have diverged; that of a fit is about the number of samples."""
SPEED_PARAMETERS = ("axial_drag",)
"""Parameters that change the steady speed at a given thrust."""


class Prior(NamedTuple):
    """Normal distribution of the parameters before the data."""

    config: VehicleConfig
    """First-principles vehicle, at z = 0."""
    biases_rad: dict[Plane, float]
    """Actuator bias of each plane at z = 0, rad."""
    mean: Array
    """(p,), mean of z."""
    covariance: Array
    """(p, p), covariance of z."""


class MapProblem(NamedTuple):
    """Data, prior and noise of an estimate."""

    prior: Prior
    datasets: Mapping[Plane, tuple[Dataset, ...]]
    """Runs of each plane that has any."""
    filters: Mapping[Plane, Sequence[Filter]]
    """Noise filter of each run."""
    levels: Mapping[Plane, Noise]
    """Noise levels of each plane."""
    stride: int
    """Samples of the 50 Hz grid per step; ``measured`` of the datasets has the same step."""


class Evaluation(NamedTuple):
    """A candidate, its simulated runs and its cost."""

    candidate: CandidateVehicle
    trajectories: Mapping[Plane, Sequence[Trajectory]]
    whitened: Mapping[Plane, Sequence[Array]]
    """Whitened residuals (samples, outputs) of each run."""
    cost: float


class Linearisation(NamedTuple):
    """Simulated runs of a candidate, and the derivatives of their outputs by its parameters."""

    evaluation: Evaluation
    output_slopes: Mapping[Plane, Sequence[Array]]
    """(samples, outputs, parameters of the plane) of each run, not whitened; see ``_columns``."""


class Score(NamedTuple):
    """Cost of a candidate and its derivatives."""

    cost: float
    """Half the squared norm of whitened residuals and of the distance from the prior mean."""
    slope: Array
    """(p,), gradient of the cost."""
    information: Array
    """(p, p), Gauss-Newton information of the data about z, without the prior."""
    runs: tuple[RunScore, ...]
    """Information and gradient of each run, in the order of the data sets."""
    linearisation: Linearisation
    """What the derivatives were computed from."""


def vehicle(prior: Prior, z: Array) -> CandidateVehicle:
    """Return the candidate vehicle at z."""
    return parameters.candidate_vehicle(prior.config, prior.biases_rad, z)


def filters(
    candidate: CandidateVehicle,
    datasets: Mapping[Plane, Sequence[Dataset]],
    levels: Mapping[Plane, Noise],
    stride: int,
) -> dict[Plane, tuple[Filter, ...]]:
    """Build the noise filter of each plane, about level flight of a candidate, for all its runs."""
    filters = {}
    for plane, group in datasets.items():
        samples = max(len(data.measured) for data in group)
        plane_filter = noise.build(
            linear_plane(candidate, plane), levels[plane], stride / RATE_HZ, samples
        )
        filters[plane] = (plane_filter,) * len(group)
    return filters


def cost(problem: MapProblem, z: Array) -> float:
    """Return the cost at z; infinite if `evaluate` returns None."""
    evaluation = evaluate(problem, z)
    return evaluation.cost if evaluation else math.inf


def evaluate(problem: MapProblem, z: Array) -> Evaluation | None:
    """Simulate the runs at z.

    Parameters
    ----------
    problem : MapProblem
        Data, noise filters and prior.
    z : ndarray, shape (p,)
        Parameters in prior standard deviations.

    Returns
    -------
    Evaluation or None
        Candidate with its cost; None if no such vehicle is possible, or if its runs diverge.
    """
    try:
        candidate = vehicle(problem.prior, z)
    except VehicleFileError:
        return None
    evaluation = _simulate_all(problem, candidate, z)
    return evaluation if evaluation.cost < DIVERGED_COST else None


def _simulate_all(problem: MapProblem, candidate: CandidateVehicle, z: Array) -> Evaluation:
    """Simulate all runs with the candidate at z."""
    speeds_mps = cruise_speeds_mps(candidate, chain.from_iterable(problem.datasets.values()))
    trajectories = {
        plane: _simulate(problem, candidate, plane, speeds_mps) for plane in problem.datasets
    }
    return _evaluation(problem, candidate, trajectories, z)


def _evaluation(
    problem: MapProblem,
    candidate: CandidateVehicle,
    trajectories: Mapping[Plane, Sequence[Trajectory]],
    z: Array,
) -> Evaluation:
    """Compare the simulated runs of the candidate at z with the measured ones."""
    whitened = {
        plane: _whiten(problem, plane, candidate, runs) for plane, runs in trajectories.items()
    }
    with np.errstate(over="ignore"):  # the cost of a candidate that diverges is infinite
        residual_sum = sum(
            float(np.sum(white**2)) for group in whitened.values() for white in group
        )
    departure = z - problem.prior.mean
    total = residual_sum + float(departure @ np.linalg.solve(problem.prior.covariance, departure))
    return Evaluation(
        candidate=candidate, trajectories=trajectories, whitened=whitened, cost=0.5 * total
    )


def at_edge(prior: Prior, z: Array) -> tuple[str, ...]:
    """Return the parameters beyond whose value no vehicle is possible.

    Parameters
    ----------
    prior : Prior
        Prior of the fit.
    z : ndarray, shape (p,)
        Parameters in prior standard deviations.

    Returns
    -------
    tuple of str
        Names; empty inside the possible vehicles.
    """
    names = []
    for i, parameter in enumerate(PARAMETERS):
        step = EDGE_STEP * (np.arange(z.size) == i)
        try:
            for neighbour in (z + step, z - step):
                vehicle(prior, neighbour)
        except VehicleFileError:
            names.append(parameter.name)
    return tuple(names)


def score(
    problem: MapProblem,
    z: Array,
    known: Evaluation | Linearisation | None = None,
) -> Score:
    """Return the cost at z, its gradient, and the Gauss-Newton information of the data.

    Parameters
    ----------
    problem : MapProblem
        Data, noise filters and prior.
    z : ndarray, shape (p,)
        Parameters in prior standard deviations; such a vehicle must be possible.
    known : Evaluation or Linearisation, optional
        What is already known at z: the result of `evaluate`, or runs and derivatives, whose noise
        filters may be others.

    Returns
    -------
    Score
        Cost and derivatives.
    """
    if isinstance(known, Linearisation):
        earlier = known.evaluation
        linearisation = known._replace(
            evaluation=_evaluation(problem, earlier.candidate, earlier.trajectories, z)
        )
    else:
        linearisation = _linearise(problem, z, known)
    prior = problem.prior
    departure = z - prior.mean
    pull = np.asarray(np.linalg.solve(prior.covariance, departure), np.float64)
    slope: Array = pull
    total, information = float(departure @ pull), np.zeros((z.size, z.size))
    runs = []
    for white, jacobian in _whiten_slopes(problem, linearisation):
        run = model_error.score_of(white, jacobian)
        total += float(np.sum(white**2))
        slope = slope + run.slope
        information += run.information
        runs.append(run)
    return Score(0.5 * total, slope, information, tuple(runs), linearisation)


def linearise(
    problem: MapProblem, z: Array, evaluation: Evaluation | None = None
) -> Iterator[tuple[Array, Array]]:
    """Yield the whitened residuals (samples, outputs) of each run and their derivatives by z.

    Parameters
    ----------
    problem : MapProblem
        Data, noise filters and prior.
    z : ndarray, shape (p,)
        Parameters in prior standard deviations.
    evaluation : Evaluation, optional
        Result of `evaluate` at z, if it is already known.

    Yields
    ------
    tuple of ndarray
        Whitened residuals (samples, outputs) and their derivatives (samples x outputs, p).

    Raises
    ------
    VehicleFileError
        No such vehicle is possible.
    """
    yield from _whiten_slopes(problem, _linearise(problem, z, evaluation))


def _linearise(problem: MapProblem, z: Array, evaluation: Evaluation | None) -> Linearisation:
    """Return the derivatives of the outputs of all runs by z."""
    evaluation = evaluation or _simulate_all(problem, vehicle(problem.prior, z), z)
    perturbations = _perturbations(problem, evaluation.candidate, z)
    output_slopes = {
        plane: _output_slopes(problem, plane, evaluation.candidate, trajectories, perturbations)
        for plane, trajectories in evaluation.trajectories.items()
    }
    return Linearisation(evaluation, output_slopes)


def _whiten_slopes(
    problem: MapProblem, linearisation: Linearisation
) -> Iterator[tuple[Array, Array]]:
    """Yield whitened residuals and their derivatives of each run; see ``linearise``."""
    for plane, runs in linearisation.output_slopes.items():
        columns = _columns(plane)
        residuals = linearisation.evaluation.whitened[plane]
        for output_slopes, residual, noise_filter in zip(
            runs, residuals, problem.filters[plane], strict=True
        ):
            whitened = noise.whiten_columns(output_slopes, noise_filter)
            jacobian = np.zeros((residual.size, len(PARAMETERS)))
            jacobian[:, columns] = whitened.reshape(residual.size, -1)
            yield residual, jacobian


def _simulate(
    problem: MapProblem,
    candidate: CandidateVehicle,
    plane: Plane,
    speeds_mps: Mapping[float, float],
) -> list[Trajectory]:
    """Simulate the runs of a plane with a candidate, whose cruise speeds by thrust are given."""
    return sensitivity.simulate(
        candidate, plane, problem.datasets[plane], problem.stride, speeds_mps
    )


def _outputs(plane: Plane) -> list[int]:
    """Return the indices of the measured states.

    Rate, angle and, in pitch, depth (opposite signs in MAVLink's axes).
    """
    return [2, 3, 4][: PLANES[plane].n_outputs]


def _whiten(
    problem: MapProblem,
    plane: Plane,
    candidate: CandidateVehicle,
    trajectories: Sequence[Trajectory],
) -> list[Array]:
    """Return the whitened residuals (samples, outputs) of each run of a plane."""
    whitened = []
    for data, trajectory, noise_filter in zip(
        problem.datasets[plane], trajectories, problem.filters[plane], strict=True
    ):
        simulated = -trajectory.track[:, _outputs(plane)]
        simulated[:, 2:] += data.start.depth_m + trajectory.first[4]  # depth, in pitch
        simulated = with_sensor_lags(simulated, candidate.sensor_lags_s, problem.stride)
        whitened.append(noise.whiten_residual(data.measured - simulated, noise_filter))
    return whitened


def _output_slopes(
    problem: MapProblem,
    plane: Plane,
    candidate: CandidateVehicle,
    trajectories: Sequence[Trajectory],
    perturbations: Sequence[Perturbation],
) -> list[Array]:
    """Return the derivatives of the residuals of each run, (samples, outputs, parameters)."""
    used = [
        perturbation
        for perturbation in perturbations
        if plane in PARAMETERS[perturbation.column].planes
    ]
    signs = np.array([-1.0 if perturbation.backward else 1.0 for perturbation in used])
    state_slopes = sensitivity.sensitivities(
        candidate,
        plane,
        problem.datasets[plane],
        trajectories,
        used,
        DIFFERENCE,
        problem.stride,
    )
    all_slopes = []
    for slopes, trajectory in zip(state_slopes, trajectories, strict=True):
        output_slopes = with_sensor_lags(
            slopes[:, _outputs(plane)], candidate.sensor_lags_s, problem.stride
        )
        _add_sensor_slopes(output_slopes, plane, trajectory, problem.stride)
        all_slopes.append(signs * output_slopes)
    return all_slopes


def _add_sensor_slopes(
    output_slopes: Array, plane: Plane, trajectory: Trajectory, stride: int
) -> None:
    """Write the derivatives of the outputs by the sensor lags, in the paper's axes."""
    outputs = trajectory.track[:, _outputs(plane)]
    for column, i in enumerate(_columns(plane)):
        name, sd = PARAMETERS[i].name, PARAMETERS[i].prior_sd
        if name == "angle_lag":
            output_slopes[:, 1, column] = -sd * outputs[:, 0]
        elif name == "depth_lag":
            output_slopes[:, 2, column] = -sd * depth_rate(outputs, stride)


@cache
def _columns(*planes: Plane) -> list[int]:
    """Return the parameters of the planes: of the body, then the tailcone, then the sensors."""
    parts = get_args(Part)
    used = parameters.parameters_of_planes(planes)
    return sorted(used, key=lambda i: parts.index(PARAMETERS[i].part))


def _perturbations(
    problem: MapProblem, candidate: CandidateVehicle, z: Array
) -> list[Perturbation]:
    """Return a candidate one step away for each parameter that the runs depend on."""
    prior, perturbations = problem.prior, []
    for i in _columns(*problem.datasets):
        step, part = DIFFERENCE * (np.arange(z.size) == i), PARAMETERS[i].part
        backward = False
        if part == "body":
            try:
                perturbed = parameters.with_body_at(candidate, prior.config, z + step)
            except VehicleFileError:
                perturbed = parameters.with_body_at(candidate, prior.config, z - step)
                backward = True
        elif part == "sensors":
            perturbed = candidate
        else:
            perturbed = candidate._replace(
                actuators=parameters.actuators(prior.config, prior.biases_rad, z + step)
            )
        perturbations.append(
            Perturbation(
                column=i,
                part=part,
                vehicle=perturbed,
                speeds_mps=cruise_speeds_mps(
                    perturbed, chain.from_iterable(problem.datasets.values())
                )
                if PARAMETERS[i].name in SPEED_PARAMETERS
                else {},
                backward=backward,
            )
        )
    return perturbations
