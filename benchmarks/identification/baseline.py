"""Common practice for comparison: output error with a general simulator and optimiser.

`scipy.signal.lsim` simulates each run from rest after its mean is removed (the "detrend" of a
toolbox). The actuator lag is taken as known from the bench test, derivatives are finite
differences, noise is assumed white, and confidence intervals come from the optimiser's Jacobian.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.optimize import least_squares

from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import response
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel
from sysid.estimation.linear.records import LinearPrior, LinearRun
from sysid.estimation.linear.response import DT
from sysid.estimation.map.fit import STRIDE

Array = NDArray[np.float64]

REST_S = 1.0
"""Part at the start of a run whose mean is subtracted from its outputs."""
REWEIGHTED = 1
"""Number of fits after which the output weights are updated."""


def estimate(records: Sequence[LinearRun], prior: LinearPrior) -> tuple[Array, Array]:
    """Return the derived parameters, as ``linear_model.derived``, and their covariance."""
    first, free = prior.model, _free(prior)
    measured = [
        record.measured - np.mean(record.measured[: int(REST_S / DT)], axis=0) for record in records
    ]
    sds = np.ones(measured[0].shape[1])

    def plant(u: Array) -> LinearModel:
        values = first.values.copy()
        values[free] = u * prior.spread[free]
        return LinearModel(first.frame, values)

    def errors(u: Array) -> Array:
        at = plant(u)
        pairs = zip(records, measured, strict=True)
        return np.concatenate([((y - simulate(at, record)) / sds).ravel() for record, y in pairs])

    u = first.values[free] / prior.spread[free]
    bounds = prior.lowest[free] / prior.spread[free], prior.highest[free] / prior.spread[free]
    for _ in range(REWEIGHTED):
        found = least_squares(errors, u, bounds=bounds)
        u = found.x
        sds = sds * np.sqrt(np.mean(found.fun.reshape(-1, sds.size) ** 2, axis=0))
    found = least_squares(errors, u, bounds=bounds)
    covariance = np.zeros((first.values.size, first.values.size))
    covariance[np.ix_(free, free)] = np.linalg.pinv(found.jac.T @ found.jac) * np.outer(
        prior.spread[free], prior.spread[free]
    )
    at = plant(found.x)
    return plants.derived(*at), plants.propagate(*at, covariance)


def simulate(plant: LinearModel, record: LinearRun) -> Array:
    """Return the outputs of one run from rest, shape (steps, outputs)."""
    A, B = plants.equations(plant.frame, plant.values[: len(NUMBERS[plant.frame.plane])])
    count = record.measured.shape[1]
    C = np.eye(len(A))[1 : 1 + count]
    angles = response.duct(plant, record.command)[::STRIDE]
    time_s = DT * np.arange(angles.size)
    return np.asarray(
        signal.lsim((A, B[:, None], C, np.zeros((count, 1))), angles, time_s)[1]
    ).reshape(-1, count)


def _free(prior: LinearPrior) -> NDArray[np.int64]:
    """Return the indices of the free parameters: those of the equation, delay and bias."""
    return np.arange(len(NUMBERS[prior.model.frame.plane]) + 2)
