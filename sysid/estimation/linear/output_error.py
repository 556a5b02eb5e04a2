"""Output error: all that a run's simulation misses is noise of the sensors (Jategaonkar 2015,
chapter 4).

Each run's starting state and gyro bias enter its outputs linearly. They are not searched for: at
every trial of the other values the best of them is subtracted (variable projection, Golub and
Pereyra 1973), with Kaufman's (1975) slope, whose gradient is exact and whose square is the
information left once the nuisances are known."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import response
from sysid.estimation.linear.linear_model import LinearModel, LinearModelStructure
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import LinearRun
from sysid.estimation.linear.response import Discrete, DuctMotion

Array = NDArray[np.float64]


class _NuisanceProjection(NamedTuple):
    """What a run's starting state and gyro bias leave in its outputs, and the QR factors of
    that."""

    columns: Array
    """(n, nuisances)"""
    Q: Array
    R: Array


class _RunResiduals(NamedTuple):
    """One run under one plant, nuisances included."""

    plant: LinearModel
    by: Discrete
    duct: DuctMotion
    sds: Array
    unknown: _NuisanceProjection
    residuals: Array
    """(n,): from rest."""


def objective(frame: LinearModelStructure, records: Sequence[LinearRun], sds: Array) -> Objective:
    """Projected residuals in units of the outputs' standard deviations ``sds``."""

    def projected(values: Array, what: Callable[[_RunResiduals], Array]) -> Array:
        parts = _all_run_residuals(LinearModel(frame, values), records, sds)
        return np.concatenate(
            [what(part) - part.unknown.Q @ (part.unknown.Q.T @ what(part)) for part in parts]
        )

    return Objective(
        lambda values: projected(values, lambda part: part.residuals),
        lambda values: projected(values, _slopes),
    )


def reduce_by_qr(
    frame: LinearModelStructure, records: Sequence[LinearRun], sds: Array
) -> Objective:
    """As many residuals as values and one more, with the cost, gradient and information of all of
    ``objective``.

    They are a triangular factor, of each run and then of all (Golub and Van Loan 2013, section
    5.3): a search, which reads nothing else of the residuals, need not handle every sample at every
    step."""
    last: dict[bytes, Array] = {}

    def factor(values: Array) -> Array:
        """Residuals and slopes are asked for at the same values, one after the other."""
        key = values.tobytes()
        if key not in last:
            last.clear()
            blocks = [
                _factor(part)
                for part in _all_run_residuals(LinearModel(frame, values), records, sds)
            ]
            last[key] = _triangle(np.concatenate(blocks))
        return last[key]

    return Objective(lambda values: factor(values)[:, -1], lambda values: factor(values)[:, :-1])


def _factor(part: _RunResiduals) -> Array:
    """Of slopes and residuals side by side: what stands below the nuisances is projected
    already."""
    known = part.unknown.columns.shape[1]
    return _triangle(np.column_stack([part.unknown.columns, _slopes(part), part.residuals]))[
        known:, known:
    ]


def _triangle(columns: Array) -> Array:
    return np.asarray(np.linalg.qr(columns, mode="r"), dtype=np.float64)


def levels(
    frame: LinearModelStructure, records: Sequence[LinearRun], sds: Array, values: Array
) -> Array:
    """Standard deviations that make the residuals at ``values`` most likely, nuisances and values
    counted off."""
    count = sds.size
    missed = objective(frame, records, sds).residuals(values).reshape(-1, count) * sds
    spent = (values.size + len(records) * (frame_states(frame) + 1)) / count
    return np.asarray(np.sqrt(np.sum(missed**2, axis=0) / max(len(missed) - spent, 1.0)))


def frame_states(frame: LinearModelStructure) -> int:
    return 4 if frame.plane == "pitch" else 3


def _all_run_residuals(
    plant: LinearModel, records: Sequence[LinearRun], sds: Array
) -> list[_RunResiduals]:
    by = response.discretise(plant)
    lengths = {len(record.measured) for record in records}
    every = response.nuisances(by, max(lengths), sds.size) / sds[:, None]
    unknown = {n: _nuisance_projection(every[:n].reshape(n * sds.size, -1)) for n in lengths}
    return [
        _run_residuals(plant, by, record, sds, unknown[len(record.measured)]) for record in records
    ]


def _nuisance_projection(columns: Array) -> _NuisanceProjection:
    """One for each length of run: what a start leaves does not depend on the commands."""
    return _NuisanceProjection(columns, *np.linalg.qr(columns))


def _run_residuals(
    plant: LinearModel, by: Discrete, record: LinearRun, sds: Array, unknown: _NuisanceProjection
) -> _RunResiduals:
    duct, rest = response.duct_motion(plant, record.command), np.zeros(len(by.transition))
    error = (
        record.measured - response.outputs_to_duct(plant, by, duct.angle_rad, rest, sds.size)
    ) / sds
    return _RunResiduals(plant, by, duct, sds, unknown, error.ravel())


def _slopes(part: _RunResiduals) -> Array:
    """Of the residuals, (n, values), from the start that fits best."""
    start = np.asarray(
        np.linalg.solve(part.unknown.R, part.unknown.Q.T @ part.residuals)[:-1], dtype=np.float64
    )
    found = response.slopes(part.plant, part.by, part.duct, start, part.sds.size) / part.sds
    return -found.reshape(-1, part.residuals.size).T
