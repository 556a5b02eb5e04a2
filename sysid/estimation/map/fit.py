"""The joint estimate of both planes: maximum a posteriori on residuals whitened by a noise model
estimated with it.

Noise from residuals and parameters under that noise take turns; then other starts, drawn from the
prior, must lead to the same end. They are followed on every other sample only, which tells ends
apart as well."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import RATE_HZ, Plane, Run
from sysid.estimation.map import problem as problems
from sysid.estimation.map.convergence import START_COST_TOLERANCE
from sysid.estimation.map.datasets import (
    STRIDE,
    Dataset,
    dataset,
    linear_plane,
    residuals,
    with_coupling_inputs,
)
from sysid.estimation.map.gauss_newton import Z_LIMIT, descend
from sysid.estimation.map.problem import DIFFERENCE, MapProblem, Prior
from sysid.estimation.map.steady_state import (
    cruise_speed_mps,
    level_elevator_rad,
    level_pitch_rad,
    trim_biases,
)
from sysid.models import noise
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES, CandidateVehicle

__all__ = [
    "DIFFERENCE",
    "START_COST_TOLERANCE",
    "STRIDE",
    "Z_LIMIT",
    "Dataset",
    "Fit",
    "Prior",
    "Progress",
    "cruise_speed_mps",
    "dataset",
    "fit",
    "level_elevator_rad",
    "level_pitch_rad",
    "linear_plane",
    "residuals",
    "trim_biases",
]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with what is being done and the share of the work that is behind, 0..1."""

PASSES = 3
"""Outer iterations: noise from residuals, then parameters under that noise."""
STARTS = 8
COARSE_TOLERANCE, FINE_TOLERANCE = 1e-4, 1e-6
"""Share of the cost that a step must promise, in passes whose noise is about to be renewed and in
the last one."""
MULTISTART_DECIMATION = 2
"""Of so many samples, other starts look at one."""
OPENINGS_S = (5.0, 15.0)
"""Of every run, which another start looks at before the whole: a vehicle of the prior that turns
the other way, or runs away where the true one does not, is so far off in the end that no slope
leads back from there."""


class Fit(NamedTuple):
    z: Array
    covariance: Array
    """Of z, from the whitened information and the prior."""
    data_information: Array
    """Of z, from the data alone."""
    vehicle: CandidateVehicle
    noise: dict[Plane, Noise]
    experiments: Mapping[Plane, tuple[Dataset, ...]]
    cost: float
    start_costs: tuple[float, ...]
    """Costs at which the other starts ended."""
    at_bounds: tuple[str, ...]
    evaluations: int
    """Steps of all searches."""


def fit(
    runs: Sequence[Run], prior: Prior, progress: Progress | None = None, starts: int = STARTS
) -> Fit:
    """Estimate z from ``runs`` (at least one); ``starts`` others are asked whether they lead to the
    same end.

    Raises:
        ValueError: there is no run.
    """
    if not runs:
        raise ValueError(
            "no run is left to fit; record rudder or elevator tests, or relax the screening"
        )
    report = progress or (lambda what, share: None)
    experiments = _datasets(runs, problems.vehicle(prior, prior.mean))
    z, work, steps = prior.mean.copy(), PASSES + 2, 0
    levels: dict[Plane, Noise] = {plane: Noise() for plane in experiments}
    for number in range(PASSES):
        report(f"fit, pass {number + 1} of {PASSES}", number / work)
        end = descend(_problem(prior, experiments, levels, z), z, COARSE_TOLERANCE)
        z, steps = end.z, steps + end.steps
        levels = _noise(prior, experiments, levels, z)
    report("fit, last pass", PASSES / work)
    problem = _problem(prior, experiments, levels, z)
    end = descend(problem, z, FINE_TOLERANCE)
    others, better, more = _search_other_starts(
        problem,
        end.z,
        starts,
        lambda share: report("fit, other starts", (PASSES + 1 + share) / work),
    )
    if better is not None:
        end = descend(problem, better, FINE_TOLERANCE)
    report("fit", 1.0)
    return Fit(
        z=end.z,
        covariance=np.linalg.inv(end.score.information + np.linalg.inv(prior.covariance)),
        data_information=end.score.information,
        vehicle=problems.vehicle(prior, end.z),
        noise=levels,
        experiments=experiments,
        cost=end.score.cost,
        start_costs=tuple(end.score.cost * share for share in others),
        at_bounds=tuple(
            n for n, value in zip(NAMES, end.z, strict=True) if abs(value) > 0.99 * Z_LIMIT
        ),
        evaluations=steps + end.steps + more,
    )


def _datasets(runs: Sequence[Run], first: CandidateVehicle) -> dict[Plane, tuple[Dataset, ...]]:
    planes: tuple[Plane, ...] = ("yaw", "pitch")
    found = {
        plane: tuple(
            with_coupling_inputs(first, dataset(run)) for run in runs if run.plane == plane
        )
        for plane in planes
    }
    return {plane: group for plane, group in found.items() if group}


def _problem(
    prior: Prior,
    experiments: Mapping[Plane, tuple[Dataset, ...]],
    levels: Mapping[Plane, Noise],
    z: Array,
) -> MapProblem:
    by = problems.filters(problems.vehicle(prior, z), experiments, levels, STRIDE)
    return MapProblem(prior, experiments, by, levels, STRIDE)


def _noise(
    prior: Prior,
    experiments: Mapping[Plane, tuple[Dataset, ...]],
    levels: Mapping[Plane, Noise],
    z: Array,
) -> dict[Plane, Noise]:
    at = problems.vehicle(prior, z)
    return {
        plane: noise.estimate(
            linear_plane(at, plane), residuals(at, group), STRIDE / RATE_HZ, levels[plane]
        )
        for plane, group in experiments.items()
    }


def _search_other_starts(
    problem: MapProblem, z: Array, starts: int, report: Callable[[float], None]
) -> tuple[list[float], Array | None, int]:
    """Ends of searches from draws of the prior, the same on every machine.

    Returns their costs as shares of that of ``z``, the best of them where it beats ``z``, and the
    steps taken."""
    thin, prior = _decimate(problem, z), problem.prior
    own = descend(thin, z, COARSE_TOLERANCE)
    best, steps = own.score.cost, own.steps
    generator, spread = np.random.default_rng(4154), np.linalg.cholesky(prior.covariance)
    shares, better = [], None
    for number in range(starts):
        report(number / starts)
        drawn = prior.mean + spread @ generator.standard_normal(len(NAMES))
        at = _feasible_start(thin, np.clip(drawn, -0.9 * Z_LIMIT, 0.9 * Z_LIMIT), z)
        for seconds in OPENINGS_S:
            opened = descend(_truncate(thin, seconds), at, COARSE_TOLERANCE)
            at, steps = opened.z, steps + opened.steps
        end = descend(thin, at, COARSE_TOLERANCE)
        shares.append(end.score.cost / best)
        steps += end.steps
        if shares[-1] < min([1.0 - START_COST_TOLERANCE, *shares[:-1]]):
            better = end.z
    return shares, better, steps


def _feasible_start(problem: MapProblem, start: Array, z: Array) -> Array:
    """``start``, or where no such vehicle can be the first half-way house towards ``z`` that
    can."""
    while not math.isfinite(problems.cost(problem, start)):
        start = 0.5 * (start + z)
    return start


def _truncate(problem: MapProblem, seconds: float) -> MapProblem:
    """The same problem on the first seconds of every run."""

    def opened(e: Dataset) -> Dataset:
        run = e.run.until(float(e.run.time_s[0]) + seconds)
        return e._replace(
            run=run, measured=e.measured[: (run.time_s.size - 1) // problem.stride + 1]
        )

    return problem._replace(
        experiments={
            plane: tuple(map(opened, group)) for plane, group in problem.experiments.items()
        }
    )


def _decimate(problem: MapProblem, z: Array) -> MapProblem:
    """The same problem on one of SKIPPED samples, under filters made for that."""
    stride = MULTISTART_DECIMATION * problem.stride
    experiments = {
        plane: tuple(e._replace(measured=e.measured[::MULTISTART_DECIMATION]) for e in group)
        for plane, group in problem.experiments.items()
    }
    by = problems.filters(problems.vehicle(problem.prior, z), experiments, problem.levels, stride)
    return MapProblem(problem.prior, experiments, by, problem.levels, stride)
