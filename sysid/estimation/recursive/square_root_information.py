"""Recursive least squares in square-root information form: the covariance stays positive definite.

Symbols: z parameters (n,), R upper triangular (n, n), d (n,). The estimate solves R z = d, and its
information matrix is R'R. New measurements y = H z + v with v white of unit variance, H (m, n), are
absorbed by an orthogonal triangularisation (Bierman 1977, chapter IV)::

    Q' [R d; H y] = [R+ d+; 0 e]
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Information(NamedTuple):
    """Information about n parameters: R z = d."""

    root: Array
    """(n, n), R, upper triangular."""
    rhs: Array
    """(n,), d."""


def empty(size: int) -> Information:
    """Return the information about ``size`` parameters before any measurement."""
    return Information(np.zeros((size, size)), np.zeros(size))


def from_normal(mean: Array, covariance: Array) -> Information:
    """Return the information of a normal distribution.

    Parameters
    ----------
    mean : ndarray, (n,)
        Mean.
    covariance : ndarray, (n, n)
        Covariance, positive definite.

    Returns
    -------
    Information
        R = inverse Cholesky factor of the covariance, triangularised, and d = R mean.
    """
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    return absorb(empty(mean.size), root, root @ mean)


def absorb(information: Information, rows: Array, values: Array) -> Information:
    """Add measurements to the information.

    Parameters
    ----------
    information : Information
        Information before the measurements.
    rows : ndarray, (m, n)
        Measurement matrix H.
    values : ndarray, (m,)
        Measurements y, each with white noise of unit variance.

    Returns
    -------
    Information
        Information after the measurements.
    """
    stacked = np.vstack(
        [np.column_stack([information.root, information.rhs]), np.column_stack([rows, values])]
    )
    triangle: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
    n = information.rhs.size
    return Information(np.triu(triangle[:n, :n]), triangle[:n, n].copy())


def combine(first: Information, second: Information) -> Information:
    """Add two independent pieces of information."""
    return absorb(first, second.root, second.rhs)


def mean(information: Information) -> Array:
    """Return the mean R^-1 d, (n,). Raise LinAlgError if a parameter is not determined."""
    return np.asarray(np.linalg.solve(information.root, information.rhs))
