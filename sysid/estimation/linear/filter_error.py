"""Filter error: what a run's simulation misses is the sea's doing, and a Kalman filter says how
likely it is.

Residuals and their slopes pass the filter of ``sysid.models.noise``, linearised about the last
estimate; what comes out is white, so least squares is maximum likelihood (Jategaonkar 2015, chapter
5). Starting states and gyro biases are states of the filter with a wide prior."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import response
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel, LinearModelStructure
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import LinearRun
from sysid.models import noise
from sysid.models.noise import Filter, Noise

Array = NDArray[np.float64]

DIFFERENCE, MIN_NUMBER = 1e-5, 0.03
"""Step of the slopes by the equation's numbers, relative, and the least size that it is relative
to."""


def build_filter(plant: LinearModel, records: Sequence[LinearRun], level: Noise) -> Filter:
    """The filter that whitens what ``plant`` misses of the runs."""
    return noise.build(
        plants.linear_plane(plant), level, response.DT, max(len(r.measured) for r in records)
    )


def predictor(
    frame: LinearModelStructure, records: Sequence[LinearRun], level: Noise, units: Filter
) -> Objective:
    """Innovations of the runs, each plane judged by its own filter, in the units of the filter
    ``units``.

    The filter holds a plane to its run however fast it would run away, so this form finds the way
    from afar; with units that stand still its least square is consistent without the likelihood's
    determinant (Ljung 1999, 7.2)."""
    numbers = len(NUMBERS[frame.plane])

    def residuals(values: Array) -> Array:
        plant = LinearModel(frame, values)
        by = build_filter(plant, records, level)._replace(whiteners=units.whiteners)
        return np.concatenate(
            [noise.whiten_residual(e, by).ravel() for e in plane_residuals(plant, records)]
        )

    def jacobian(values: Array) -> Array:
        plant, first = LinearModel(frame, values), residuals(values)
        steps = DIFFERENCE * np.maximum(np.abs(values[:numbers]), MIN_NUMBER)
        ways = np.diag(steps) @ np.eye(numbers, values.size)
        moved = [
            (residuals(values + way) - first) / step for way, step in zip(ways, steps, strict=True)
        ]
        by = build_filter(plant, records, level)._replace(whiteners=units.whiteners)
        return np.column_stack([*moved, _whitened_slopes(plant, records, by)[:, numbers:]])

    return Objective(residuals, jacobian)


def whiten_residuals(
    frame: LinearModelStructure, records: Sequence[LinearRun], by_filter: Filter
) -> Objective:
    """Residuals whitened by one filter, which stands still: generalised least squares.

    Nothing but what the commands caused counts as knowledge of the plane; what the sea's colour
    seems to tell of its poles rests on the noise model, and would be believed too well."""

    def residuals(values: Array) -> Array:
        return np.concatenate(
            [
                noise.whiten_residual(e, by_filter).ravel()
                for e in plane_residuals(LinearModel(frame, values), records)
            ]
        )

    return Objective(
        residuals, lambda values: _whitened_slopes(LinearModel(frame, values), records, by_filter)
    )


def _whitened_slopes(plant: LinearModel, records: Sequence[LinearRun], by_filter: Filter) -> Array:
    """Of residuals by each value, (n, values)."""
    by = response.discretise(plant)
    rest = np.zeros(len(by.transition))
    runs = []
    for record in records:
        slopes = response.slopes(
            plant, by, response.duct_motion(plant, record.command), rest, _count(record)
        )
        runs.append(
            np.column_stack([noise.whiten_residual(-slope, by_filter).ravel() for slope in slopes])
        )
    return np.concatenate(runs)


def plane_residuals(plant: LinearModel, records: Sequence[LinearRun]) -> list[Array]:
    """Measured less simulated from rest of each run, (steps, outputs)."""
    by = response.discretise(plant)
    rest = np.zeros(len(by.transition))
    return [r.measured - response.outputs(plant, by, r.command, rest, _count(r)) for r in records]


def levels(plant: LinearModel, records: Sequence[LinearRun], start: Noise) -> Noise:
    """Noise that makes what ``plant`` misses most likely."""
    return noise.estimate(
        plants.linear_plane(plant), plane_residuals(plant, records), response.DT, start
    )


def _count(record: LinearRun) -> int:
    return int(record.measured.shape[1])
