"""Least squares that grow row by row, in square-root information form: no covariance can lose its
positive sign.

An estimate is the solution of R z = rhs, R upper triangular, its information R'R. New rows are
absorbed by one orthogonal triangulation (Bierman 1977, chapter IV)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Information(NamedTuple):
    """What is known of n numbers."""

    root: Array
    """(n, n), upper triangular."""
    rhs: Array
    """(n,)."""


def empty(size: int) -> Information:
    """No knowledge of ``size`` numbers."""
    return Information(np.zeros((size, size)), np.zeros(size))


def from_normal(mean: Array, covariance: Array) -> Information:
    """A normal belief, shapes (n,) and (n, n) positive definite."""
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    return absorb(empty(mean.size), root, root @ mean)


def absorb(known: Information, rows: Array, values: Array) -> Information:
    """With ``values`` (m,) measured of ``rows`` (m, n) times the numbers, each with a unit of white
    noise."""
    stacked = np.vstack([np.column_stack([known.root, known.rhs]), np.column_stack([rows, values])])
    triangle: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
    n = known.rhs.size
    return Information(np.triu(triangle[:n, :n]), triangle[:n, n].copy())


def combine(known: Information, more: Information) -> Information:
    """Two independent pieces of information as one."""
    return absorb(known, more.root, more.rhs)


def mean(known: Information) -> Array:
    """The most likely numbers, (n,). Raises LinAlgError where some are not known at all."""
    return np.asarray(np.linalg.solve(known.root, known.rhs))


def covariance(known: Information) -> Array:
    """Of the numbers, (n, n). Raises LinAlgError where some are not known at all."""
    inverse = np.linalg.inv(known.root)
    return np.asarray(inverse @ inverse.T)
