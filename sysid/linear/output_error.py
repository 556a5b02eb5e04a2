"""Output error: all that a run's simulation misses is noise of the sensors (Jategaonkar 2015, chapter 4).

Each run's starting state and gyro bias enter its outputs linearly. They are not searched for: at every trial of the
other values the best of them is subtracted (variable projection, Golub and Pereyra 1973), with Kaufman's (1975) slope,
whose gradient is exact and whose square is the information left once the nuisances are known.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.linear import response
from sysid.linear.objective import Objective
from sysid.linear.plant import Frame, Plant
from sysid.linear.records import Record
from sysid.linear.response import Discrete

Array = NDArray[np.float64]
Basis = tuple[Array, Array]
"""QR factors of a run's nuisances."""


class _Trial(NamedTuple):
    """All runs under one set of values."""

    plant: Plant
    by: Discrete
    bases: dict[int, Basis]
    misses: list[tuple[Array, Array]]
    """Of each run its residual beyond the nuisances, and these."""


def _try(plant: Plant, records: Sequence[Record], sds: Array) -> _Trial:
    by = response.discretise(plant)
    bases = _bases(by, records, sds)
    return _Trial(plant, by, bases, [_missed(plant, by, record, sds, bases) for record in records])


def objective(frame: Frame, records: Sequence[Record], sds: Array) -> Objective:
    """Projected residuals in units of the outputs' standard deviations ``sds``."""

    last: dict[bytes, _Trial] = {}

    def tried(values: Array) -> _Trial:
        """Residuals and slopes are asked for at the same values, one after the other."""
        key = values.tobytes()
        if key not in last:
            last.clear()
            last[key] = _try(Plant(frame, values), records, sds)
        return last[key]

    def residuals(values: Array) -> Array:
        return np.concatenate([missed for missed, _ in tried(values).misses])

    def jacobian(values: Array) -> Array:
        trial = tried(values)
        return np.concatenate(
            [_slopes(trial, record, start, sds) for record, (_, start) in zip(records, trial.misses, strict=True)]
        )

    return Objective(residuals, jacobian)


def levels(frame: Frame, records: Sequence[Record], sds: Array, values: Array) -> Array:
    """Standard deviations that make the residuals at ``values`` most likely, nuisances and values counted off."""
    count = sds.size
    missed = objective(frame, records, sds).residuals(values).reshape(-1, count) * sds
    spent = (values.size + len(records) * (frame_states(frame) + 1)) / count
    return np.asarray(np.sqrt(np.sum(missed**2, axis=0) / max(len(missed) - spent, 1.0)))


def frame_states(frame: Frame) -> int:
    return 4 if frame.plane == "pitch" else 3


def _bases(by: Discrete, records: Sequence[Record], sds: Array) -> dict[int, Basis]:
    """One basis for each length of run: what a start leaves does not depend on the commands."""
    lengths = {len(record.measured) for record in records}
    unknown = response.nuisances(by, max(lengths), sds.size) / sds[:, None]
    return {n: np.linalg.qr(unknown[:n].reshape(n * sds.size, -1)) for n in lengths}


def _missed(plant: Plant, by: Discrete, record: Record, sds: Array, bases: dict[int, Basis]) -> tuple[Array, Array]:
    """Residual of a run beyond its nuisances, and the nuisances: its starting state and gyro bias."""
    rest = np.zeros(len(by.transition))
    error = ((record.measured - response.outputs(plant, by, record.command, rest, sds.size)) / sds).ravel()
    Q, R = bases[len(record.measured)]
    known: Array = Q.T @ error
    return error - Q @ known, np.asarray(np.linalg.solve(R, known))


def _slopes(trial: _Trial, record: Record, start: Array, sds: Array) -> Array:
    found = response.slopes(trial.plant, trial.by, record.command, start[:-1], sds.size) / sds
    slopes: Array = -found.reshape(len(found), -1)
    Q = trial.bases[len(record.measured)][0]
    return np.asarray((slopes - (slopes @ Q) @ Q.T).T)
