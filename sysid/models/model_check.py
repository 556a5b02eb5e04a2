"""Checks of numbers in a model file that types cannot express; each returns a text, or none.

The text names key, value and what is possible.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

MAX_ROUNDING = 1e-6
"""Asymmetry, and negative eigenvalue, of a correlation matrix that rounding may cause."""


def table_error(key: str, table: Mapping[Any, object], names: Iterable[str]) -> str:
    """Return which name of a table is missing or unknown; empty for none.

    Parameters
    ----------
    key : str
        Key of the table.
    table : mapping
        The table.
    names : iterable of str
        Names that it must have, and no others.

    Returns
    -------
    str
        Error text.
    """
    known = [str(name) for name in names]
    if missing := next((name for name in known if name not in table), None):
        return f"{key}: missing key {missing}"
    if unknown := next((str(name) for name in table if name not in known), None):
        return f"{key}.{unknown}: unknown key; expected {', '.join(known)}"
    return ""


def range_error(key: str, value: float, limits: tuple[float, float]) -> str:
    """Return that a value is outside its limits; empty if it is inside.

    Parameters
    ----------
    key : str
        Key of the value.
    value : float
        The value.
    limits : tuple of float
        Smallest and largest possible value.

    Returns
    -------
    str
        Error text.
    """
    low, high = limits
    return "" if low <= value <= high else f"{key} = {value:g}: expected {low:g} to {high:g}"


def names_error(key: str, names: Sequence[str], known: Collection[str]) -> str:
    """Return which of several names stands twice or is unknown; empty for none.

    Parameters
    ----------
    key : str
        Key of the names.
    names : sequence of str
        The names.
    known : collection of str
        Possible names; empty if every name is possible.

    Returns
    -------
    str
        Error text.
    """
    if twice := next((name for name in names if names.count(name) > 1), None):
        return f"{key}: {twice!r} stands twice; expected different names"
    if known and (unknown := next((name for name in names if name not in known), None)):
        return f"{key}: {unknown!r} is unknown; expected {', '.join(known)}"
    return ""


def length_error(key: str, values: Sequence[object], count: int) -> str:
    """Return that a list has another length; empty if it has the right one.

    Parameters
    ----------
    key : str
        Key of the list.
    values : sequence
        The list.
    count : int
        Its right length.

    Returns
    -------
    str
        Error text.
    """
    return "" if len(values) == count else f"{key}: has {len(values)} entries; expected {count}"


def covariance_error(key: str, matrix: Sequence[Sequence[float]], count: int) -> str:
    """Return why a matrix is no covariance; empty if it is one, to rounding.

    Parameters
    ----------
    key : str
        Key of the matrix.
    matrix : sequence of sequence of float
        Rows.
    count : int
        Number of rows and of columns.

    Returns
    -------
    str
        Error text.

    Notes
    -----
    A covariance C has variances that are not negative, is symmetric, and is positive semidefinite.
    The last two are checked on C_ij / sqrt(C_ii C_jj), so that units do not matter.
    """
    rows = [(f"{key}[{i}]", row) for i, row in enumerate(matrix)]
    for name, entries in [(key, matrix), *rows]:
        if text := length_error(name, entries, count):
            return text
    values = np.array(matrix, dtype=float).reshape(count, count)
    variances = np.diag(values)
    if negative := np.flatnonzero(variances < 0.0).tolist():
        i = negative[0]
        return f"{key}[{i}][{i}] = {variances[i]:g}: expected a variance, which is not negative"
    sds = np.sqrt(variances)
    sds[sds == 0.0] = 1.0
    correlation = values / sds[:, None] / sds
    asymmetry = np.abs(correlation - correlation.T)
    if np.any(asymmetry > MAX_ROUNDING):
        i, j = divmod(int(np.argmax(asymmetry)), count)
        return (
            f"{key}[{i}][{j}] = {values[i, j]:g}: expected {values[j, i]:g}, the value of"
            f" [{j}][{i}]: a covariance is symmetric"
        )
    smallest = float(np.min(np.linalg.eigvalsh(correlation), initial=0.0))
    if smallest < -MAX_ROUNDING * max(count, 1):
        return (
            f"{key}: has a negative eigenvalue ({smallest:.2g} of its correlations); expected a"
            " covariance, which has none"
        )
    return ""
