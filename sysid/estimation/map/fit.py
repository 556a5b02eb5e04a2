"""Joint maximum a posteriori estimate of both planes, with the noise model estimated alongside.

The estimate alternates (Jategaonkar 2015, ch. 5): noise levels from the residuals of the present
parameters, then the parameters of the least cost under these levels (`gauss_newton`, cost in
`problem`). In these passes the noise filter is that of level flight; the last one has a filter for
the motion of each run. Then searches from other starts, drawn from the prior, must end at the same
cost. They use every second sample only, which is enough to distinguish minima, and the filter of
level flight.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleFileError
from sysid.data.runs import Run
from sysid.estimation.map import bounds, model_error
from sysid.estimation.map import problem as problems
from sysid.estimation.map.convergence import START_COST_TOLERANCE
from sysid.estimation.map.datasets import (
    STEP_S,
    STRIDE,
    Dataset,
    datasets_of,
    max_leads_s,
    residuals,
)
from sysid.estimation.map.gauss_newton import Z_LIMIT, SearchEnd, descend, within_bounds
from sysid.estimation.map.manoeuvre_filters import manoeuvre_filters
from sysid.estimation.map.model_error import RunScatter
from sysid.estimation.map.problem import Evaluation, Linearisation, MapProblem, Prior
from sysid.estimation.map.steady_state import linear_plane
from sysid.models import noise, parameters
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import Plane

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with the present step and the completed share of the work, 0 to 1."""

PASSES = 3
"""Outer iterations: noise from residuals, then parameters under that noise."""
STARTS = 8
"""Number of further starts, drawn from the prior."""
COARSE_TOLERANCE, FINE_TOLERANCE = 1e-4, 1e-6
"""Predicted relative decrease of the cost that ends a search.

In passes before the noise is updated again, and in the last pass.
"""
MULTISTART_DECIMATION = 2
"""Restarts use every second sample: enough to distinguish local minima, at half the cost."""
OPENING_TOLERANCE = 1e-3
"""The same for the initial parts of the runs, whose end is only a start."""
REJECTED_COST_RATIO = 1.0 + START_COST_TOLERANCE
"""Cost over that of the estimate from which on the data reject the end of a search.

Such an end is no other vehicle that the tests admit: of a cost of thousands a hundredth is a
likelihood ratio of more than e^10. The search is repeated on the whole runs from nearer to the
estimate: the initial parts alone may lead to the same end from any start."""
BELOW_ZERO = 2e-3
"""Distance of an estimated delay of zero below its bound, in prior standard deviations."""
BETTER_COST = 2.0
"""Decrease of the cost from which on the end of a start is searched with all samples.

A likelihood ratio of e^2, as of two standard deviations."""
MAX_REPEATS = 3
"""Maximum number of repetitions of such a search."""
RESTART_SPANS_S = (5.0, 15.0)
"""Initial parts of every run (s) that a restart fits before the whole.

A vehicle drawn from the prior may turn the other way, or be unstable where the true one is stable.
Late in a run it is then so far off that no gradient leads back.
"""


class Fit(NamedTuple):
    """Result of the joint estimate."""

    z: Array
    """(p,), parameters in prior standard deviations, in the order of `parameters.NAMES`."""
    covariance: Array
    """(p, p), covariance of z: noise and prior, model structure, and how commands were held."""
    data_information: Array
    """(p, p), information about z from the data alone."""
    vehicle: CandidateVehicle
    """Vehicle at z."""
    noise: dict[Plane, Noise]
    """Estimated noise levels of each plane."""
    datasets: Mapping[Plane, tuple[Dataset, ...]]
    """Fitted runs of each plane."""
    cost: float
    """Negative log posterior at z, without constants."""
    start_costs: tuple[float, ...]
    """Costs at which the searches from other starts ended."""
    at_bounds: tuple[str, ...]
    """Names of the parameters at a bound, see `bounds.ReachedBounds`."""
    evaluations: int
    """Steps of all searches."""
    at_edge: tuple[str, ...] = ()
    """Names of the parameters beyond whose value no vehicle is possible."""
    run_scatter: RunScatter = RunScatter()
    """Scatter of the parameters between runs beyond noise; runs in the order of `datasets`."""
    prior_conflict: float = 0.0
    """How far z contradicts the prior, from 0 to 1; see `model_error`."""

    @property
    def deviating_run(self) -> str:
        """Name of the run without which the scatter is smallest."""
        runs = [data.run.name for group in self.datasets.values() for data in group]
        return runs[self.run_scatter.run]


def fit(
    runs: Sequence[Run], prior: Prior, progress: Progress | None = None, starts: int = STARTS
) -> Fit:
    """Estimate the parameters z from the runs.

    Parameters
    ----------
    runs : sequence of Run
        Runs of one or both planes, at least one.
    prior : Prior
        Mean and covariance of z, vehicle file and actuator biases.
    progress : callable, optional
        Called with the present step and the completed share of the work, 0 to 1.
    starts : int
        Number of further starts that must lead to the same minimum.

    Returns
    -------
    Fit
        Estimate, covariance, noise levels and the costs of all starts.

    Raises
    ------
    ValueError
        There is no run.
    VehicleFileError
        The vehicle of the prior is impossible, or its simulated runs diverge.
    """
    if not runs:
        raise ValueError("no run is left to fit; record rudder or elevator tests")
    # Cost: ``problem``. PASSES times: z by Gauss-Newton for given noise levels, then noise levels
    # (``noise.estimate``) for given z. Then z to the fine tolerance, and
    #     covariance = (information of the data + prior covariance^-1)^-1, widened by `model_error`.
    report = progress or (lambda what, ratio: None)
    first = problems.vehicle(prior, prior.mean)
    leads_s = max_leads_s(runs, first)
    datasets = datasets_of(runs, first, leads_s)
    z, work_steps, steps = prior.mean.copy(), PASSES + 2, 0
    levels: dict[Plane, Noise] = {plane: Noise() for plane in datasets}
    linearisation: Linearisation | None = None
    for pass_index in range(PASSES):
        report(f"fit, pass {pass_index + 1} of {PASSES}", pass_index / work_steps)
        problem = _problem(prior, datasets, levels, z)
        start_runs = linearisation or problems.evaluate(problem, within_bounds(prior, z))
        if start_runs is None:
            raise VehicleFileError("its simulated tests diverge")
        optimum = descend(problem, z, COARSE_TOLERANCE, start_runs=start_runs)
        z, steps, linearisation = optimum.z, steps + optimum.steps, optimum.score.linearisation
        levels = _noise(prior, datasets, levels, z)
        if (updated_s := max_leads_s(runs, problems.vehicle(prior, z))) != leads_s:
            leads_s, datasets = updated_s, datasets_of(runs, first, updated_s)
            linearisation = None
    report("fit, last pass", PASSES / work_steps)
    problem = last_problem(prior, datasets, levels, z)
    optimum = descend(problem, z, FINE_TOLERANCE, start_runs=linearisation)
    start_cost_ratios, better_z, restart_steps = _search_other_starts(
        problem,
        optimum.z,
        starts,
        lambda ratio: report("fit, other starts", (PASSES + 1 + ratio) / work_steps),
    )
    if better_z is not None:
        other = descend(problem, better_z, FINE_TOLERANCE)
        optimum, start_cost_ratios = _better_of(optimum, other, start_cost_ratios)
    optimum = _without_delays_of_zero(problem, optimum)
    run_scatter = model_error.scatter(optimum.score.runs)
    prior_precision = np.asarray(np.linalg.inv(prior.covariance), np.float64)
    conflict = model_error.prior_conflict(
        optimum.z - prior.mean, optimum.score.information, prior_precision
    )
    report("fit", 1.0)
    return Fit(
        z=optimum.z,
        covariance=model_error.covariance(
            optimum.score.information, prior_precision, run_scatter.value, conflict
        )
        + model_error.command_time_covariance(
            {plane: max(data.run.delay_sd_s for data in group) for plane, group in datasets.items()}
        ),
        data_information=optimum.score.information,
        vehicle=problems.vehicle(prior, optimum.z),
        noise=levels,
        datasets=datasets,
        cost=optimum.score.cost,
        start_costs=tuple(optimum.score.cost * ratio for ratio in start_cost_ratios),
        at_bounds=bounds.reached(optimum.z, prior.config.tailcone.lag_relative_sd).decisive,
        evaluations=steps + optimum.steps + restart_steps,
        at_edge=problems.at_edge(prior, optimum.z),
        run_scatter=run_scatter,
        prior_conflict=conflict,
    )


def last_problem(
    prior: Prior,
    datasets: Mapping[Plane, tuple[Dataset, ...]],
    levels: Mapping[Plane, Noise],
    z: Array,
) -> MapProblem:
    """Return the problem of the last pass, with noise filters about the motion of each run at z."""
    filters = manoeuvre_filters(problems.vehicle(prior, z), datasets, levels)
    return MapProblem(prior=prior, datasets=datasets, filters=filters, levels=levels, stride=STRIDE)


def _problem(
    prior: Prior,
    datasets: Mapping[Plane, tuple[Dataset, ...]],
    levels: Mapping[Plane, Noise],
    z: Array,
) -> MapProblem:
    """Return the problem of a pass, with noise filters about level flight at z."""
    filters = problems.filters(problems.vehicle(prior, z), datasets, levels, STRIDE)
    return MapProblem(prior=prior, datasets=datasets, filters=filters, levels=levels, stride=STRIDE)


def _noise(
    prior: Prior,
    datasets: Mapping[Plane, tuple[Dataset, ...]],
    levels: Mapping[Plane, Noise],
    z: Array,
) -> dict[Plane, Noise]:
    """Estimate the noise levels of each plane from the residuals at z."""
    vehicle = problems.vehicle(prior, z)
    return {
        plane: noise.estimate(
            linear_plane(vehicle, plane), residuals(vehicle, group), STEP_S, levels[plane]
        )
        for plane, group in datasets.items()
    }


def _search_other_starts(
    problem: MapProblem, z: Array, start_count: int, report: Callable[[float], None]
) -> tuple[list[float], Array | None, int]:
    """Search from starts drawn from the prior, the same on every machine.

    Return the ratios of their costs to that of ``z``, the best of them if it is better than ``z``,
    and the number of steps.
    """
    # start = m + L n, with m and P = L L^T mean and covariance of the prior and n standard normal,
    # clipped to 0.9 of the bounds.
    if not start_count:
        return [], None, 0
    decimated, prior = _decimate(problem, z), problem.prior
    reference = descend(decimated, z, COARSE_TOLERANCE)
    reference_cost, steps = reference.score.cost, reference.steps
    generator, root = np.random.default_rng(4154), np.linalg.cholesky(prior.covariance)
    spans = [*(_truncate(decimated, seconds) for seconds in RESTART_SPANS_S), decimated]
    paths = [[reference] * len(spans)]  # a known end of every span
    ends = [reference]
    cost_ratios, better_z, best_cost = list[float](), None, reference_cost
    for index in range(start_count):
        report(index / start_count)
        sample = prior.mean + root @ generator.standard_normal(len(NAMES))
        start = np.clip(sample, -0.9 * Z_LIMIT, 0.9 * Z_LIMIT)
        path, path_steps = _search_spans(spans, start, z, paths)
        paths.append(path)
        end, steps = path[-1], steps + path_steps
        for _ in range(MAX_REPEATS):
            if end.score.cost <= REJECTED_COST_RATIO * reference_cost:
                break
            start, start_runs = _feasible_start(decimated, 0.5 * (start + z), z)
            end = descend(decimated, start, COARSE_TOLERANCE, ends, start_runs)
            steps += end.steps
        ends.append(end)
        cost_ratios.append(end.score.cost / reference_cost)
        if end.score.cost < best_cost - BETTER_COST:
            best_cost, better_z = end.score.cost, end.z
    return cost_ratios, better_z, steps


def _without_delays_of_zero(problem: MapProblem, optimum: SearchEnd) -> SearchEnd:
    """Return an optimum whose delays of zero have no slope, so no standard deviation either."""
    z = optimum.z.copy()
    for index, zero in parameters.delays_of_zero(problem.prior.config).items():
        if z[index] <= zero:
            z[index] = zero - BELOW_ZERO
    if np.array_equal(z, optimum.z):
        return optimum
    return optimum._replace(z=z, score=problems.score(problem, z))


def _better_of(
    first: SearchEnd, other: SearchEnd, cost_ratios: Sequence[float]
) -> tuple[SearchEnd, list[float]]:
    """Return the better of two optima, and the costs of all starts over its cost.

    The starts use every second sample, which may rank the two in the other order.
    """
    best, least = min(first, other, key=lambda end: end.score.cost), min(cost_ratios)
    costs = [
        other.score.cost * ratio / least
        if ratio - least < 1.0 - ratio
        else first.score.cost * ratio
        for ratio in cost_ratios
    ]
    return best, [cost / best.score.cost for cost in costs]


def _search_spans(
    spans: Sequence[MapProblem], start: Array, z: Array, paths: Sequence[list[SearchEnd]]
) -> tuple[list[SearchEnd], int]:
    """Search from span to span; return the end of each, and the number of steps.

    The end of a span whose vehicle diverges later, in the next one, is moved towards ``z``. A
    search that comes to the end of an earlier path follows that path from there.
    """
    path: list[SearchEnd] = []
    steps = 0
    for index, span in enumerate(spans):
        tolerance = OPENING_TOLERANCE if index < len(RESTART_SPANS_S) else COARSE_TOLERANCE
        start, start_runs = _feasible_start(span, start, z)
        end = descend(span, start, tolerance, [earlier[index] for earlier in paths], start_runs)
        steps += end.steps
        if end.joined is not None:
            return [*path, *paths[end.joined][index:]], steps
        path.append(end)
        start = end.z
    return path, steps


def _feasible_start(problem: MapProblem, start: Array, z: Array) -> tuple[Array, Evaluation]:
    """Halve the distance of ``start`` to ``z`` until such a vehicle is possible; add its runs."""
    start = within_bounds(problem.prior, start)
    while (evaluation := problems.evaluate(problem, start)) is None:
        start = 0.5 * (start + z)
    return start, evaluation


def _truncate(problem: MapProblem, seconds: float) -> MapProblem:
    """Restrict a problem to the first seconds of every run."""

    def truncate_dataset(data: Dataset) -> Dataset:
        """Return the first ``seconds`` of a data set."""
        run = data.run.until(float(data.run.time_s[0]) + seconds)
        return data._replace(
            run=run, measured=data.measured[: (run.time_s.size - 1) // problem.stride + 1]
        )

    return problem._replace(
        datasets={
            plane: tuple(map(truncate_dataset, group)) for plane, group in problem.datasets.items()
        }
    )


def _decimate(problem: MapProblem, z: Array) -> MapProblem:
    """Restrict a problem to every MULTISTART_DECIMATION-th sample, with filters for that rate."""
    stride = MULTISTART_DECIMATION * problem.stride
    datasets = {
        plane: tuple(
            data._replace(measured=data.measured[::MULTISTART_DECIMATION]) for data in group
        )
        for plane, group in problem.datasets.items()
    }
    filters = problems.filters(problems.vehicle(problem.prior, z), datasets, problem.levels, stride)
    return MapProblem(
        prior=problem.prior,
        datasets=datasets,
        filters=filters,
        levels=problem.levels,
        stride=stride,
    )
