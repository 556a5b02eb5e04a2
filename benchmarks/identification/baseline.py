"""Common practice for comparison: output error with a general simulator and optimiser.

`scipy.signal.lsim` simulates each run from rest after its mean is removed (the "detrend" of a
toolbox). The actuator lag is taken as known from the bench test, derivatives are finite
differences, noise is assumed white, and confidence intervals come from the optimiser's Jacobian.
Studies of accuracy use `simulate_compiled`, which gives lsim's numbers to rounding in a hundredth
of its time; the time of common practice is that of lsim for the same number of simulations.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.linalg import expm
from scipy.optimize import least_squares

from mavlink_io.jit import entry_point
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import response
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel
from sysid.estimation.linear.records import LinearPrior, LinearRun
from sysid.estimation.map.datasets import STEP_S, STRIDE

Array = NDArray[np.float64]
Simulator = Callable[[LinearModel, LinearRun], Array]
"""Return the outputs of one run from rest, shape (steps, outputs)."""

REST_S = 1.0
"""Part at the start of a run whose mean is subtracted from its outputs."""
REWEIGHTED = 1
"""Number of fits after which the output weights are updated."""


def estimate(
    records: Sequence[LinearRun], prior: LinearPrior, simulator: Simulator | None = None
) -> tuple[Array, Array]:
    """Return the derived parameters, as ``linear_model.derived``, and their covariance.

    ``simulator`` is `simulate_compiled` by default.
    """
    simulate = simulator or simulate_compiled
    first, free = prior.model, _free(prior)
    measured = [
        record.measured - np.mean(record.measured[: int(REST_S / STEP_S)], axis=0)
        for record in records
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


def simulate_lsim(plant: LinearModel, record: LinearRun) -> Array:
    """Return the outputs of one run from rest by `scipy.signal.lsim`, shape (steps, outputs)."""
    A, B, C, angles = _system(plant, record)
    time_s, D = STEP_S * np.arange(angles.size), np.zeros((len(C), 1))
    return np.asarray(signal.lsim((A, B, C, D), angles, time_s)[1]).reshape(-1, len(C))


def simulate_compiled(plant: LinearModel, record: LinearRun) -> Array:
    """Return the outputs of one run from rest as lsim does, with a compiled recursion.

    The input is linear between samples (first-order hold)::

        x[k+1] = A_d x[k] + B_0 u[k] + B_1 u[k+1],    exp([[A h, B h, 0], [0, 0, 1], [0, 0, 0]])
                                                       = [[A_d, B_0 + B_1, B_1], ...]
    """
    A, B, C, angles = _system(plant, record)
    n = len(A)
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n : n + 1], block[n, n + 1] = A * STEP_S, B * STEP_S, 1.0
    transition = expm(block)[:n]
    late = np.ascontiguousarray(transition[:, n + 1])
    early = transition[:, n] - late
    states = _first_order_hold(np.ascontiguousarray(transition[:, :n]), early, late, angles)
    return states @ C.T


def _system(plant: LinearModel, record: LinearRun) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C and the duct angle (rad) at the output steps of a run."""
    A, B = plants.equations(plant.frame, plant.values[: len(NUMBERS[plant.frame.plane])])
    C = np.eye(len(A))[1 : 1 + record.measured.shape[1]]
    angles = np.ascontiguousarray(response.duct(plant, record.command)[::STRIDE])
    return A, B[:, None], C, angles


@entry_point
def _first_order_hold(transition: Array, early: Array, late: Array, angles: Array) -> Array:
    """Return the states at all samples, (samples, n), from rest."""
    n = early.size
    states = np.zeros((angles.size, n))
    for k in range(1, angles.size):
        for i in range(n):
            total = early[i] * angles[k - 1] + late[i] * angles[k]
            for j in range(n):
                total += transition[i, j] * states[k - 1, j]
            states[k, i] = total
    return states


def _free(prior: LinearPrior) -> NDArray[np.int64]:
    """Return the indices of the free parameters: those of the equation, delay and bias."""
    return np.arange(len(NUMBERS[prior.model.frame.plane]) + 2)
