"""One plane from its runs, by output error or by filter error."""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import PREROLL_S
from sysid.estimation.linear import (
    cramer_rao,
    filter_error,
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
"""Motion before a test that is used, the duct's settling included. The sea moves a vehicle away
from any simulation, and an unstable one fast: output error, which knows no sea, begins shortly
before the test."""

PASSES = 3
"""Outer iterations of filter error: values, then the noise that explains what they miss."""
FINAL_TOLERANCES = (1e-2, 1e-2, 1e-3)
"""Relative cost changes that end output error's passes: under levels that are far off the least
lies elsewhere."""
NOISE_TOLERANCE = 0.02
"""Relative change of the sensors' levels that ends output error's passes."""
COARSE_TOLERANCE = 1e-4
"""Relative cost change that ends a pass whose noise levels are about to be renewed."""


class PlaneEstimate(NamedTuple):
    plant: LinearModel
    covariance: Array
    """Of the values, the inverse of their information."""
    level: Noise | None
    """Sea and sensors; none is known to output error, which takes both for sensors."""
    sensors: Array
    """Standard deviations of the outputs' own noise."""
    objective: Objective
    cost: float
    start_costs: tuple[float, ...]
    evaluations: int
    lowest: Array
    highest: Array
    """Bounds within which the values were sought."""


def estimate(
    records: Sequence[LinearRun],
    belief: LinearPrior,
    method: Method = "filter-error",
    start: Array | None = None,
    others: int = multistart.STARTS,
) -> PlaneEstimate:
    """Values of one plane from its runs (at least one).

    Args:
        records: runs of one plane.
        belief: where to look; the tailcone's lag in it is a bench measurement.
        method: which noise the runs are taken to hold.
        start: values to begin with; the belief's own without.
        others: how many other starts must end at the same cost.

    Raises:
        NotUniqueError: the runs do not name one plant.
        ValueError: there is no run.
    """
    if not records:
        raise ValueError("an estimate needs at least one run")
    found, weighted, level, sensors = _passes(method)(
        records, belief, belief.plant.values if start is None else start
    )
    best, costs = multistart.search_from_starts(weighted, belief, found, others)
    multistart.require_unique(weighted, belief, best, costs)
    return _estimate(best, weighted, level, sensors, belief)._replace(start_costs=tuple(costs))


def descend(
    records: Sequence[LinearRun], belief: LinearPrior, method: Method, start: Array
) -> PlaneEstimate:
    """The same from one start, nobody asking whether the runs name one plant."""
    return _estimate(*_passes(method)(records, belief, start), belief)


def _estimate(
    found: SearchResult,
    weighted: Objective,
    level: Noise | None,
    sensors: Array,
    belief: LinearPrior,
) -> PlaneEstimate:
    plant = LinearModel(belief.plant.frame, found.values)
    covariance = cramer_rao.of_information(
        plant, multistart.information_at(weighted, found.values)
    ).covariance
    return PlaneEstimate(
        plant,
        covariance,
        level,
        sensors,
        weighted,
        found.cost,
        (),
        found.evaluations,
        belief.lowest,
        belief.highest,
    )


PassResult = tuple[SearchResult, Objective, Noise | None, Array]


def _passes(method: Method) -> Callable[[Sequence[LinearRun], LinearPrior, Array], PassResult]:
    return _output_error if method == "output-error" else _filter_error


def _output_error(records: Sequence[LinearRun], belief: LinearPrior, values: Array) -> PassResult:
    frame = belief.plant.frame
    sds = cramer_rao.sensor_sds(Noise())[: records[0].measured.shape[1]]

    def weighted() -> Objective:
        return objective.with_bench(output_error.reduce_by_qr(frame, records, sds), belief.plant)

    for tolerance in FINAL_TOLERANCES:
        values = multistart.search(weighted(), belief, values, tolerance).values
        before, sds = sds, output_error.levels(frame, records, sds, values)
        if np.max(np.abs(sds / before - 1.0)) < NOISE_TOLERANCE:
            break
    return multistart.search(weighted(), belief, values), weighted(), None, sds


def _filter_error(records: Sequence[LinearRun], belief: LinearPrior, values: Array) -> PassResult:
    frame, level = belief.plant.frame, Noise()
    for _ in range(PASSES):
        units = filter_error.build_filter(LinearModel(frame, values), records, level)
        data = filter_error.predictor(frame, records, level, units)
        values = multistart.search(
            objective.with_bench(data, belief.plant), belief, values, COARSE_TOLERANCE
        ).values
        # From the default levels every time: those of a plane that was still wrong may be past
        # return.
        level = filter_error.levels(LinearModel(frame, values), records, Noise())
    by = filter_error.build_filter(LinearModel(frame, values), records, level)
    weighted = objective.with_bench(filter_error.whiten_residuals(frame, records, by), belief.plant)
    return (
        multistart.search(weighted, belief, values),
        weighted,
        level,
        cramer_rao.sensor_sds(level),
    )
