"""Filter error: what a run's simulation misses is the sea's doing, and a Kalman filter says how likely it is.

Residuals and their slopes pass the filter of ``sysid.noise``, linearised about the last estimate; what comes out is
white, so least squares is maximum likelihood (Jategaonkar 2015, chapter 5). Starting states and gyro biases are states
of the filter with a wide prior.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sysid import noise
from sysid.linear import plant as plants
from sysid.linear import response
from sysid.linear.objective import Objective
from sysid.linear.plant import Frame, Plant
from sysid.linear.records import Record
from sysid.noise import Filter, Noise

Array = NDArray[np.float64]


def filtering(plant: Plant, records: Sequence[Record], level: Noise) -> Filter:
    """The filter that whitens what ``plant`` misses of the runs."""
    return noise.build(plants.linear_plane(plant), level, response.DT, max(len(r.measured) for r in records))


def objective(frame: Frame, records: Sequence[Record], by_filter: Filter) -> Objective:
    """Whitened residuals of the runs; the filter stands still while the values move."""

    def residuals(values: Array) -> Array:
        return np.concatenate([noise.whitened(e, by_filter).ravel() for e in missed(Plant(frame, values), records)])

    def jacobian(values: Array) -> Array:
        plant = Plant(frame, values)
        by = response.discretise(plant)
        rest = np.zeros(len(by.transition))
        columns = [
            [noise.whitened(-s, by_filter).ravel() for s in response.slopes(plant, by, r.command, rest, _count(r))]
            for r in records
        ]
        return np.concatenate([np.column_stack(run) for run in columns])

    return Objective(residuals, jacobian)


def missed(plant: Plant, records: Sequence[Record]) -> list[Array]:
    """Measured less simulated from rest of each run, (steps, outputs)."""
    by = response.discretise(plant)
    rest = np.zeros(len(by.transition))
    return [r.measured - response.outputs(plant, by, r.command, rest, _count(r)) for r in records]


def levels(plant: Plant, records: Sequence[Record], start: Noise) -> Noise:
    """Noise that makes what ``plant`` misses most likely."""
    return noise.estimate(plants.linear_plane(plant), missed(plant, records), response.DT, start)


def _count(record: Record) -> int:
    return int(record.measured.shape[1])
