"""ARX estimate of the response from command to rate, by least squares over all tests of a plane.

Model (Ljung 1999, section 4.2), one constant d_j per test j for trim and slow drift::

    r_k + a_1 r_(k-1) + ... + a_n r_(k-n) = b_1 u_(k-1) + ... + b_m u_(k-m) + d_j + e_k
    G(w) = sum_i b_i z^-i / (1 + sum_i a_i z^-i),   z = exp(j w DT)

The order minimises Akaike's criterion; the delay is covered by leading b_i near zero. The
standard deviation follows from the covariance s^2 (Phi' Phi)^-1 to first order; it is right for
white e, which large motion and slow disturbances are not.

Large motion and slow disturbances bias such an estimate by several degrees below the crossover. The
same estimate on simulated rates of a model has the same bias, so the two are compared.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.runs import RATE_HZ

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DECIMATION = 10
"""Samples per step of the model."""
DT_S = DECIMATION / RATE_HZ
"""Step of the model (s)."""
ORDERS = (2, 4, 6, 8, 10, 12, 14, 16)
"""Orders n of the rate's part that are tried."""
EXTRA_INPUTS = 3
"""Additional lags of the command, m = n + 3, for the delay."""
RANK_TOLERANCE = 1e-9
"""Relative singular value below which the equations count as dependent."""
MIN_VARIANCE = 1e-16
"""Smallest variance of the residuals, (rad/s)^2."""
MIN_SAMPLES_PER_PARAMETER = 5.0
"""Smallest number of samples per parameter of an order that is tried."""


class Record(NamedTuple):
    """One test from before its start, at ``RATE_HZ``."""

    command_rad: Array
    rate_radps: Array


class ArxFit(NamedTuple):
    """Fitted model."""

    order: int
    a: Array
    """(n,), coefficients of the past rates."""
    b: Array
    """(m,), coefficients of the past commands."""
    covariance: Array
    """(n + m, n + m), covariance of a and b."""


class ArxResponse(NamedTuple):
    """Response of the model with standard deviations."""

    response: ComplexArray
    magnitude_sd: Array
    """Relative standard deviation of the magnitude."""
    phase_sd_rad: Array


def fit(records: Sequence[Record], orders: Sequence[int] = ORDERS) -> ArxFit | None:
    """Fit the order with the smallest value of Akaike's criterion.

    Parameters
    ----------
    records : Sequence of Record
        Open-loop tests of one plane.
    orders : Sequence of int
        Orders that are tried.

    Returns
    -------
    ArxFit or None
        None if the tests are too short for the smallest order, or do not excite it.
    """
    lead = max(orders) + EXTRA_INPUTS
    fits = [
        candidate
        for order in orders
        if (candidate := _solve(_reduce(records, order, lead), order)) is not None
    ]
    return min(fits, key=lambda item: item[0])[1] if fits else None


def fit_without_each(records: Sequence[Record], order: int) -> list[ArxFit]:
    """Fit one order without each test in turn, for the scatter between tests.

    Parameters
    ----------
    records : Sequence of Record
        Open-loop tests of one plane.
    order : int
        Order of the model.

    Returns
    -------
    list of ArxFit
        One fit per test; fewer if the other tests do not determine the model.
    """
    blocks = _reduce(records, order, order + EXTRA_INPUTS)
    solutions = [_solve(blocks[:j] + blocks[j + 1 :], order) for j in range(len(blocks))]
    return [solution[1] for solution in solutions if solution is not None]


def response(model: ArxFit, frequency_radps: Array) -> ArxResponse:
    """Return the model's response from command to rate.

    Parameters
    ----------
    model : ArxFit
        Fitted model.
    frequency_radps : ndarray
        Frequencies below pi / `DT_S` (rad/s).

    Returns
    -------
    ArxResponse
        Response and standard deviations.
    """
    delays = np.exp(-1j * np.outer(frequency_radps * DT_S, 1.0 + np.arange(model.b.size)))
    denominator = 1.0 + delays[:, : model.a.size] @ model.a
    values: ComplexArray = np.asarray(delays @ model.b / denominator, dtype=np.complex128)
    # relative derivative of G: -z^-i / A for a_i, z^-i / B for b_i
    gradient = np.hstack(
        [
            -delays[:, : model.a.size] / denominator[:, None],
            delays / (values * denominator)[:, None],
        ]
    )
    magnitude, phase = (
        np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", part, model.covariance, part), 0.0))
        for part in (gradient.real, gradient.imag)
    )
    return ArxResponse(values, magnitude, phase)


def _means(values: Array) -> Array:
    """Return means over `DT_S`."""
    whole = values.size // DECIMATION * DECIMATION
    return np.asarray(values[:whole].reshape(-1, DECIMATION).mean(axis=1))


class _Block(NamedTuple):
    """Least-squares equations of one test, without its constant, as a triangular matrix."""

    triangle: Array
    """R of the QR factors of [Phi, r], Phi and r about their means."""
    samples: int


def _reduce(records: Sequence[Record], order: int, lead: int) -> list[_Block]:
    """Return the equations of each test; all orders with the same lead use the same samples."""
    blocks = []
    for record in records:
        command, rate = _means(record.command_rad), _means(record.rate_radps)
        rows = rate.size - lead
        if rows < 2:
            continue
        columns = [-rate[lead - i : lead - i + rows] for i in range(1, order + 1)]
        columns += [command[lead - i : lead - i + rows] for i in range(1, order + EXTRA_INPUTS + 1)]
        equations = np.column_stack([*columns, rate[lead:]])
        centred = equations - equations.mean(axis=0)
        blocks.append(_Block(np.asarray(np.linalg.qr(centred, mode="r")), rows))
    return blocks


def _solve(blocks: Sequence[_Block], order: int) -> tuple[float, ArxFit] | None:
    """Return Akaike's criterion and the fit; None if the tests do not determine it."""
    if not blocks:
        return None
    stacked = np.vstack([block.triangle for block in blocks])
    phi, y = stacked[:, :-1], stacked[:, -1]
    samples, parameters = sum(block.samples for block in blocks), phi.shape[1] + len(blocks)
    if samples < MIN_SAMPLES_PER_PARAMETER * parameters:
        return None
    if not np.any(phi[:, order:]):
        return None
    # simulated rates may satisfy several models of this order: the shortest is as good as any
    theta = np.asarray(np.linalg.lstsq(phi, y, rcond=RANK_TOLERANCE)[0], dtype=np.float64)
    variance = float(np.sum((y - phi @ theta) ** 2)) / (samples - parameters)
    variance = max(variance, MIN_VARIANCE)
    fitted = ArxFit(
        order=order,
        a=theta[:order],
        b=theta[order:],
        covariance=variance * np.linalg.pinv(phi.T @ phi, hermitian=True),
    )
    return samples * math.log(variance) + 2.0 * parameters, fitted
