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
from sysid.estimation.linear.linear_model import Plant
from sysid.estimation.linear.multistart import Found
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import Belief, Record
from sysid.models.noise import Noise

Array = NDArray[np.float64]
Method = Literal["output-error", "filter-error"]
LEADS_S: dict[Method, float] = {"output-error": 4.0, "filter-error": PREROLL_S}
"""Motion before a test that is used, the duct's settling included. The sea moves a vehicle away
from any simulation, and an unstable one fast: output error, which knows no sea, begins shortly
before the test."""

PASSES = 3
"""Outer iterations of filter error: values, then the noise that explains what they miss."""
FINER = (1e-2, 1e-2, 1e-3)
"""Relative cost changes that end output error's passes: under levels that are far off the least
lies elsewhere."""
SETTLED = 0.02
"""Relative change of the sensors' levels that ends output error's passes."""
COARSE = 1e-4
"""Relative cost change that ends a pass whose noise levels are about to be renewed."""


class Estimate(NamedTuple):
    plant: Plant
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
    records: Sequence[Record],
    belief: Belief,
    method: Method = "filter-error",
    start: Array | None = None,
    others: int = multistart.STARTS,
) -> Estimate:
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
    best, costs = multistart.from_everywhere(weighted, belief, found, others)
    multistart.require_unique(weighted, belief, best, costs)
    return _estimate(best, weighted, level, sensors, belief)._replace(start_costs=tuple(costs))


def descend(records: Sequence[Record], belief: Belief, method: Method, start: Array) -> Estimate:
    """The same from one start, nobody asking whether the runs name one plant."""
    return _estimate(*_passes(method)(records, belief, start), belief)


def _estimate(
    found: Found, weighted: Objective, level: Noise | None, sensors: Array, belief: Belief
) -> Estimate:
    plant = Plant(belief.plant.frame, found.values)
    covariance = cramer_rao.of_information(
        plant, multistart.information_at(weighted, found.values)
    ).covariance
    return Estimate(
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


Passed = tuple[Found, Objective, Noise | None, Array]


def _passes(method: Method) -> Callable[[Sequence[Record], Belief, Array], Passed]:
    return _output_error if method == "output-error" else _filter_error


def _output_error(records: Sequence[Record], belief: Belief, values: Array) -> Passed:
    frame = belief.plant.frame
    sds = cramer_rao.sensors(Noise())[: records[0].measured.shape[1]]

    def weighted() -> Objective:
        return objective.with_bench(output_error.reduced(frame, records, sds), belief.plant)

    for tolerance in FINER:
        values = multistart.search(weighted(), belief, values, tolerance).values
        before, sds = sds, output_error.levels(frame, records, sds, values)
        if np.max(np.abs(sds / before - 1.0)) < SETTLED:
            break
    return multistart.search(weighted(), belief, values), weighted(), None, sds


def _filter_error(records: Sequence[Record], belief: Belief, values: Array) -> Passed:
    frame, level = belief.plant.frame, Noise()
    for _ in range(PASSES):
        units = filter_error.filtering(Plant(frame, values), records, level)
        data = filter_error.predictor(frame, records, level, units)
        values = multistart.search(
            objective.with_bench(data, belief.plant), belief, values, COARSE
        ).values
        # From the default levels every time: those of a plane that was still wrong may be past
        # return.
        level = filter_error.levels(Plant(frame, values), records, Noise())
    by = filter_error.filtering(Plant(frame, values), records, level)
    weighted = objective.with_bench(filter_error.whitened(frame, records, by), belief.plant)
    return multistart.search(weighted, belief, values), weighted, level, cramer_rao.sensors(level)
