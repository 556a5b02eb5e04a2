"""Filter error method: residuals contain disturbance and sensor noise, whitened by a Kalman filter.

Symbols: y measured outputs, y(theta) simulated outputs, W the linear map of the whole noise filter
of `sysid.models.noise`, linearised about the last estimate. Whitened residuals and their
derivatives (Jategaonkar 2015, chapter 5)::

    e(theta) = W (y - y(theta)),    J = -W dy/dtheta,    cost = 1/2 |e|^2

The whitened residuals are white, so that least squares is maximum likelihood. Initial states and
gyro biases are states of the filter with a wide prior.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import linear_model, response
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel, LinearModelStructure
from sysid.estimation.linear.objective import Objective
from sysid.estimation.linear.records import LinearRun
from sysid.estimation.map.datasets import STEP_S
from sysid.models import noise
from sysid.models.noise import Filter, Noise

Array = NDArray[np.float64]

DIFFERENCE, MIN_NUMBER = 1e-5, 0.03
"""Relative difference step of the coefficients, and the smallest size that it is relative to."""


def build_filter(model: LinearModel, records: Sequence[LinearRun], level: Noise) -> Filter:
    """Build the filter that whitens the residuals of ``model``."""
    return noise.build(
        linear_model.linear_plane(model), level, STEP_S, max(len(r.measured) for r in records)
    )


class _Prediction(NamedTuple):
    """One-step predictions of all runs by a candidate plane."""

    ducts_rad: Sequence[Array]
    """Duct angle in each run, rad."""
    noise_filter: Filter
    innovations: Array
    """(n,), of all runs, divided by their standard deviations."""


def predictor(
    frame: LinearModelStructure, records: Sequence[LinearRun], level: Noise, unit_filter: Filter
) -> Objective:
    """Return the cost function of the one-step predictions.

    Each candidate plane has its own noise filter, which keeps its state near the measured motion
    even if the candidate is unstable: the search converges from far away. The innovations of all
    candidates are scaled with the whiteners of ``unit_filter``. With such fixed units the minimum
    is consistent without the determinant of the likelihood (Ljung 1999, 7.2).
    """
    coefficient_count = len(NUMBERS[frame.plane])
    stored: dict[bytes, _Prediction] = {}

    def predict(model: LinearModel, ducts_rad: Sequence[Array]) -> _Prediction:
        """Return the scaled innovations of all runs for their duct angles."""
        noise_filter = build_filter(model, records, level)._replace(whiteners=unit_filter.whiteners)
        innovations = [
            noise.whiten_residual(residual, noise_filter).ravel()
            for residual in _residuals_to_ducts(model, records, ducts_rad)
        ]
        return _Prediction(ducts_rad, noise_filter, np.concatenate(innovations))

    def predict_at(values: Array) -> _Prediction:
        """Return the prediction at ``values``; the last one is stored, for their derivatives."""
        key = values.tobytes()
        if key not in stored:
            stored.clear()
            model = LinearModel(frame, values)
            stored[key] = predict(model, [response.duct(model, r.command) for r in records])
        return stored[key]

    def jacobian(values: Array) -> Array:
        """Return the slopes of the innovations by the values, (n, p).

        By the coefficients, which do not change the duct angles, they are forward differences, by
        the tailcone values analytic.
        """
        nominal = predict_at(values)
        steps = DIFFERENCE * np.maximum(np.abs(values[:coefficient_count]), MIN_NUMBER)
        perturbations = np.diag(steps) @ np.eye(coefficient_count, values.size)
        columns = [
            (
                predict(LinearModel(frame, values + perturbation), nominal.ducts_rad).innovations
                - nominal.innovations
            )
            / step
            for perturbation, step in zip(perturbations, steps, strict=True)
        ]
        model = LinearModel(frame, values)
        return np.column_stack(
            [
                *columns,
                _whitened_slopes(model, records, nominal.noise_filter)[:, coefficient_count:],
            ]
        )

    return Objective(lambda values: predict_at(values).innovations, jacobian)


def whiten_residuals(
    frame: LinearModelStructure, records: Sequence[LinearRun], by_filter: Filter
) -> Objective:
    """Return the cost function of residuals that one fixed filter whitens.

    This is generalised least squares. Only the response to commands counts as information about the
    plane. The colour of the disturbance also depends on the poles, but through the noise model; its
    information would make the estimate appear too certain.
    """

    def residuals(values: Array) -> Array:
        """Return the residuals of all runs, whitened by a fixed filter."""
        return np.concatenate(
            [
                noise.whiten_residual(residual, by_filter).ravel()
                for residual in plane_residuals(LinearModel(frame, values), records)
            ]
        )

    return Objective(
        residuals, lambda values: _whitened_slopes(LinearModel(frame, values), records, by_filter)
    )


def _whitened_slopes(model: LinearModel, records: Sequence[LinearRun], by_filter: Filter) -> Array:
    """Return the derivatives of the whitened residuals by each value, (n, p)."""
    discrete = response.discretise(model)
    zero_state = np.zeros(len(discrete.transition))
    blocks = []
    for record in records:
        slopes = response.slopes(
            model, discrete, response.duct_motion(model, record.command), zero_state, _count(record)
        )
        whitened = noise.whiten_columns(np.moveaxis(-slopes, 0, 2), by_filter)
        blocks.append(whitened.reshape(-1, len(slopes)))
    return np.concatenate(blocks)


def plane_residuals(model: LinearModel, records: Sequence[LinearRun]) -> list[Array]:
    """Measured minus simulated outputs of each run, (steps, outputs), from a state of zero."""
    return _residuals_to_ducts(model, records, [response.duct(model, r.command) for r in records])


def _residuals_to_ducts(
    model: LinearModel, records: Sequence[LinearRun], ducts_rad: Sequence[Array]
) -> list[Array]:
    """Return the residuals of `plane_residuals` for known duct angles."""
    discrete = response.discretise(model)
    zero_state = np.zeros(len(discrete.transition))
    return [
        record.measured
        - response.outputs_to_duct(model, discrete, duct_rad, zero_state, _count(record))
        for record, duct_rad in zip(records, ducts_rad, strict=True)
    ]


def levels(model: LinearModel, records: Sequence[LinearRun], start: Noise) -> Noise:
    """Estimate the noise levels from the residuals of ``model``."""
    return noise.estimate(
        linear_model.linear_plane(model), plane_residuals(model, records), STEP_S, start
    )


def _count(record: LinearRun) -> int:
    """Return the number of outputs of a run."""
    return int(record.measured.shape[1])
