"""Output error method: the residuals of a run are sensor noise (Jategaonkar 2015, chapter 4).

The initial state and gyro bias of each run, b, enter its outputs linearly; they are eliminated
(variable projection, Golub and Pereyra 1973). Symbols: e residual from a state of zero (n,), N
nuisance columns (n, m), J = de/dtheta (n, p), all divided by the sensor standard deviations::

    N = Q R,    e_p = (I - Q Q') e,    J_p = (I - Q Q') J(b),    R b = Q'e

J(b) are the derivatives for the best initial state b (Kaufman 1975): the gradient is exact, and
J_p'J_p is the information that remains with unknown nuisances.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import response
from sysid.estimation.linear.linear_model import LinearModel, LinearModelStructure
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import LinearRun
from sysid.estimation.linear.response import Discrete, DuctMotion
from sysid.planes import PLANES

Array = NDArray[np.float64]


class _NuisanceProjection(NamedTuple):
    """Effect of initial state and gyro bias on the outputs of a run, and its QR factors."""

    columns: Array
    """(n, nuisances), derivatives of the outputs by each nuisance."""
    Q: Array
    R: Array


class _RunResiduals(NamedTuple):
    """Residuals of one run for one plane."""

    model: LinearModel
    discrete: Discrete
    duct: DuctMotion
    sds: Array
    nuisances: _NuisanceProjection
    residuals: Array
    """(n,), from a state of zero, in units of ``sds``."""


def objective(frame: LinearModelStructure, records: Sequence[LinearRun], sds: Array) -> Objective:
    """Return the projected residuals in units of the outputs' standard deviations ``sds``."""

    def projected(values: Array, columns: Callable[[_RunResiduals], Array]) -> Array:
        """Return columns of all runs without their part in the span of the nuisances."""
        parts = _all_run_residuals(LinearModel(frame, values), records, sds)
        return np.concatenate(
            [
                columns(part) - part.nuisances.Q @ (part.nuisances.Q.T @ columns(part))
                for part in parts
            ]
        )

    return Objective(
        lambda values: projected(values, lambda part: part.residuals),
        lambda values: projected(values, _slopes),
    )


def reduce_by_qr(
    frame: LinearModelStructure, records: Sequence[LinearRun], sds: Array
) -> Objective:
    """Return p + 1 residuals that have cost, gradient and information of those of `objective`.

    The residuals are the triangular factor of (J, e), of each run and then of all runs (Golub and
    Van Loan 2013, section 5.3). A search uses only cost, gradient and information, so that it need
    not process every sample at every step.
    """
    stored: dict[bytes, Array] = {}

    def factor(values: Array) -> Array:
        """Return the triangular factor at ``values``.

        The last one is stored, since residuals and slopes are both needed.
        """
        key = values.tobytes()
        if key not in stored:
            stored.clear()
            blocks = [
                _factor(part)
                for part in _all_run_residuals(LinearModel(frame, values), records, sds)
            ]
            stored[key] = _triangle(np.concatenate(blocks))
        return stored[key]

    return Objective(lambda values: factor(values)[:, -1], lambda values: factor(values)[:, :-1])


def _factor(part: _RunResiduals) -> Array:
    """Triangular factor of (nuisances, J, e); below the nuisance rows it is projected."""
    nuisance_count = part.nuisances.columns.shape[1]
    return _triangle(np.column_stack([part.nuisances.columns, _slopes(part), part.residuals]))[
        nuisance_count:, nuisance_count:
    ]


def _triangle(columns: Array) -> Array:
    """Return the upper triangular factor R of the QR decomposition."""
    return np.asarray(np.linalg.qr(columns, mode="r"), dtype=np.float64)


def levels(
    frame: LinearModelStructure, records: Sequence[LinearRun], sds: Array, values: Array
) -> Array:
    """Return the standard deviations of the outputs from the residuals at ``values``.

    The degrees of freedom of values and nuisances are subtracted, shared equally by the outputs.
    """
    count = sds.size
    residuals = objective(frame, records, sds).residuals(values).reshape(-1, count) * sds
    used_degrees = (values.size + len(records) * (frame_states(frame) + 1)) / count
    return np.asarray(
        np.sqrt(np.sum(residuals**2, axis=0) / max(len(residuals) - used_degrees, 1.0))
    )


def frame_states(frame: LinearModelStructure) -> int:
    """Return the number of states of a plane."""
    return len(PLANES[frame.plane].states)


def _all_run_residuals(
    model: LinearModel, records: Sequence[LinearRun], sds: Array
) -> list[_RunResiduals]:
    """Return the residuals of all runs; runs of equal length share their nuisance projection."""
    discrete = response.discretise(model)
    lengths = {len(record.measured) for record in records}
    all_columns = response.nuisances(discrete, max(lengths), sds.size) / sds[:, None]
    projections = {
        n: _nuisance_projection(all_columns[:n].reshape(n * sds.size, -1)) for n in lengths
    }
    return [
        _run_residuals(model, discrete, record, sds, projections[len(record.measured)])
        for record in records
    ]


def _nuisance_projection(columns: Array) -> _NuisanceProjection:
    """Return the QR factors of the nuisance columns, which do not depend on the command."""
    return _NuisanceProjection(columns, *np.linalg.qr(columns))


def _run_residuals(
    model: LinearModel,
    discrete: Discrete,
    record: LinearRun,
    sds: Array,
    nuisances: _NuisanceProjection,
) -> _RunResiduals:
    """Return the residual of one run from a state of zero."""
    duct = response.duct_motion(model, record.command)
    zero_state = np.zeros(len(discrete.transition))
    error = (
        record.measured
        - response.outputs_to_duct(model, discrete, duct.angle_rad, zero_state, sds.size)
    ) / sds
    return _RunResiduals(
        model=model,
        discrete=discrete,
        duct=duct,
        sds=sds,
        nuisances=nuisances,
        residuals=error.ravel(),
    )


def _slopes(part: _RunResiduals) -> Array:
    """Return the derivatives of the residuals, (n, p), for the best initial state."""
    start = np.asarray(
        np.linalg.solve(part.nuisances.R, part.nuisances.Q.T @ part.residuals)[:-1],
        dtype=np.float64,
    )
    output_slopes = (
        response.slopes(part.model, part.discrete, part.duct, start, part.sds.size) / part.sds
    )
    return -output_slopes.reshape(-1, part.residuals.size).T
