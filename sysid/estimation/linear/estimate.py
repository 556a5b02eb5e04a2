"""Estimate of one plane from its runs, by the output error or the filter error method."""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import PREROLL_S
from sysid.estimation.linear import (
    cramer_rao,
    filter_error,
    linear_model,
    multistart,
    objective,
    output_error,
)
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.multistart import SearchResult
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import LinearPrior, LinearRun
from sysid.models.noise import Noise

Array = NDArray[np.float64]
Method = Literal["output-error", "filter-error"]
LEADS_S: dict[Method, float] = {"output-error": 4.0, "filter-error": PREROLL_S}
"""Time before a test that is used, s; the settling of the duct is included.

Disturbances move a vehicle away from its simulation, and an unstable vehicle quickly. Output error
has no model of disturbances; its simulation therefore begins shortly before the test.
"""

PASSES = 3
"""Outer iterations of filter error: values, then noise levels from the residuals."""
FINAL_TOLERANCES = (1e-2, 1e-2, 1e-3)
"""Relative cost changes that end the passes of output error.

Early passes are coarse: with wrong noise levels the minimum is elsewhere.
"""
NOISE_TOLERANCE = 0.02
"""Relative change of the sensor levels below which the passes of output error end."""
COARSE_TOLERANCE = 1e-4
"""Relative cost change that ends a pass before the noise levels are updated again."""

ZERO_DELAY_SD_S = 1e-3
"""Standard deviation that stands for that of a delay at its limit of zero, so that the covariance
can be inverted; it is not reported."""


class PlaneEstimate(NamedTuple):
    """Estimate of one plane."""

    model: LinearModel
    """Estimated values."""
    covariance: Array
    """(p, p), covariance of the values: the inverse of their information, and for the delay the
    unknown times of the commands."""
    level: Noise | None
    """Levels of disturbance and sensor noise.

    None for output error, which has sensor noise only.
    """
    sensors: Array
    """(outputs,), standard deviations of the sensor noise."""
    objective: Objective
    """Cost function of the last pass."""
    cost: float
    start_costs: tuple[float, ...]
    """Costs at which the searches from other starts ended."""
    evaluations: int
    lowest: Array
    """(p,), lower bounds of the search."""
    highest: Array
    """(p,), upper bounds of the search."""
    failures: tuple[str, ...] = ()
    """Reasons why the estimate is not unique; empty for a unique one."""


def estimate(
    records: Sequence[LinearRun],
    prior: LinearPrior,
    method: Method = "filter-error",
    start: Array | None = None,
    others: int = multistart.STARTS,
) -> PlaneEstimate:
    """Estimate the values of one plane from its runs and check that they are unique.

    Parameters
    ----------
    records : sequence of LinearRun
        Runs of one plane, at least one.
    prior : LinearPrior
        Prior and bounds; its mean counts as a measurement (`LinearPrior.measured_sds`).
    method : {'output-error', 'filter-error'}
        Noise model: sensor noise only, or disturbance and sensor noise.
    start : ndarray, (p,), optional
        Initial values; by default the prior mean.
    others : int
        Number of further starts that must end at the same cost.

    Returns
    -------
    PlaneEstimate
        Values, covariance and noise levels, and why they are not unique.

    Raises
    ------
    NotUniqueError
        The runs leave a combination of values undetermined.
    ValueError
        There is no run.
    """
    if not records:
        raise ValueError("an estimate needs at least one run")
    solution, weighted_objective, level, sensors = _passes(method)(
        records, prior, prior.model.values if start is None else start
    )
    best_solution, start_costs = multistart.search_from_starts(
        weighted_objective, prior, solution, others
    )
    failures = multistart.uniqueness_failures(weighted_objective, prior, best_solution, start_costs)
    return _estimate(records, best_solution, weighted_objective, level, sensors, prior)._replace(
        start_costs=tuple(start_costs), failures=failures
    )


def descend(
    records: Sequence[LinearRun], prior: LinearPrior, method: Method, start: Array
) -> PlaneEstimate:
    """Estimate from one start, without the check that the solution is unique.

    Parameters
    ----------
    records : sequence of LinearRun
        Runs of one plane.
    prior : LinearPrior
        Prior and bounds of the values.
    method : Method
        Estimation method.
    start : ndarray, shape (p,)
        Values at which the search starts, in the order of `names`.

    Returns
    -------
    PlaneEstimate
        Estimate at the local minimum.
    """
    return _estimate(records, *_passes(method)(records, prior, start), prior)


def _estimate(
    records: Sequence[LinearRun],
    solution: SearchResult,
    weighted_objective: Objective,
    level: Noise | None,
    sensors: Array,
    prior: LinearPrior,
) -> PlaneEstimate:
    """Return the estimate with the covariance at the solution."""
    values = solution.values.copy()
    information = multistart.information_at(weighted_objective, values)
    i = linear_model.names(prior.model.frame.plane).index(multistart.DELAY)
    if multistart.is_delay_zero(prior, values):
        # The others' covariance is that with the delay held at zero.
        values[i] = information[i, :] = information[:, i] = 0.0
        information[i, i] = ZERO_DELAY_SD_S**-2
    model = LinearModel(prior.model.frame, values)
    covariance = cramer_rao.of_information(model, information).covariance
    covariance[i, i] += max(record.delay_sd_s for record in records) ** 2
    return PlaneEstimate(
        model=model,
        covariance=covariance,
        level=level,
        sensors=sensors,
        objective=weighted_objective,
        cost=solution.cost,
        start_costs=(),
        evaluations=solution.evaluations,
        lowest=prior.lowest,
        highest=prior.highest,
    )


PassResult = tuple[SearchResult, Objective, Noise | None, Array]


def _passes(method: Method) -> Callable[[Sequence[LinearRun], LinearPrior, Array], PassResult]:
    """Return the estimation function of a method."""
    return _output_error if method == "output-error" else _filter_error


def _output_error(records: Sequence[LinearRun], prior: LinearPrior, values: Array) -> PassResult:
    """Alternate values and sensor levels until the levels converge."""
    frame = prior.model.frame
    sds = cramer_rao.sensor_sds(Noise())[: records[0].measured.shape[1]]

    def weighted_objective() -> Objective:
        return objective.with_prior(output_error.reduce_by_qr(frame, records, sds), prior)

    for tolerance in FINAL_TOLERANCES:
        values = multistart.search(weighted_objective(), prior, values, tolerance).values
        previous_sds, sds = sds, output_error.levels(frame, records, sds, values)
        if np.max(np.abs(sds / previous_sds - 1.0)) < NOISE_TOLERANCE:
            break
    return multistart.search(weighted_objective(), prior, values), weighted_objective(), None, sds


def _filter_error(records: Sequence[LinearRun], prior: LinearPrior, values: Array) -> PassResult:
    """Alternate values and noise levels; then estimate with a fixed filter."""
    frame, level = prior.model.frame, Noise()
    for _ in range(PASSES):
        unit_filter = filter_error.build_filter(LinearModel(frame, values), records, level)
        predictor = filter_error.predictor(frame, records, level, unit_filter)
        values = multistart.search(
            objective.with_prior(predictor, prior), prior, values, COARSE_TOLERANCE
        ).values
        # Start from the default levels every time: levels of a wrong plane may be far off.
        level = filter_error.levels(LinearModel(frame, values), records, Noise())
    noise_filter = filter_error.build_filter(LinearModel(frame, values), records, level)
    weighted_objective = objective.with_prior(
        filter_error.whiten_residuals(frame, records, noise_filter), prior
    )
    return (
        multistart.search(weighted_objective, prior, values),
        weighted_objective,
        level,
        cramer_rao.sensor_sds(level),
    )
