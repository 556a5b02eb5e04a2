"""Single values that their neighbours contradict, in log formats without a checksum.

ArduPilot's .bin and PX4's .ulg have no checksums, so a flipped bit shows in its effect only. A
sample is contradicted if it differs from both neighbours, in the same direction, by more than the
floor of its unit and more than NOISE_RATIO standard deviations of the noise, while the neighbours
agree. The first and the last sample have one neighbour, and are judged by END_SAMPLES. A flipped
bit below these limits cannot be distinguished from noise and stays.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Array
from sysid.data.readers.samples import (
    GAP_INTERVALS,
    MAX_ABS_VALUE,
    FileDamage,
    MessageColumns,
    ahead_of_others,
)
from sysid.signal_processing import MAD_TO_SD

NOISE_RATIO = 8.0
"""Smallest spike in standard deviations of the noise: 1e-15 of Gaussian samples are beyond."""
AGREEMENT = 0.5
"""Largest difference of the two neighbours, as a fraction of the spike."""
MIN_SAMPLES = 8
"""Number of samples below which the noise is not estimated."""
MAX_GAP_PERIODS = 1000.0
"""Longest time between an outermost sample and the next one, in intervals of the samples."""
END_SAMPLES = 5
"""Samples at an end of a column by which the outermost one is judged."""
MIN_DISPLACEMENT_S = 0.025
"""Smallest displacement of a time that is reported. In five logs of PX4 (pyulog's test files) it
leaves out 1 of 64,000 sound samples."""


class Plausible(NamedTuple):
    """Plausible changes of a column."""

    floor: float
    """Smallest spike that is reported, in the unit of the column."""
    period: float = 0.0
    """Period of an angle; 0 for other quantities."""


def merged(*tables: Mapping[str, Mapping[str, Plausible]]) -> dict[str, dict[str, Plausible]]:
    """Return one table of the columns to check.

    Parameters
    ----------
    *tables : mapping of str to mapping of str to Plausible
        Columns by message and name; a message may be in several tables.

    Returns
    -------
    dict of str to dict of str to Plausible
        All columns of each message.
    """
    columns: defaultdict[str, dict[str, Plausible]] = defaultdict(dict)
    for table in tables:
        for message, checks in table.items():
            columns[message] |= checks
    return dict(columns)


def drop_contradicted(
    tables: Mapping[str, MessageColumns], columns: Mapping[str, Mapping[str, Plausible]]
) -> tuple[dict[str, MessageColumns], FileDamage]:
    """Return the tables without contradicted samples, and what was left out.

    Parameters
    ----------
    tables : mapping of str to MessageColumns
        Messages by name.
    columns : mapping of str to mapping of str to Plausible
        Columns to check, by message and name.

    Returns
    -------
    tables : dict of str to MessageColumns
        The tables.
    damage : FileDamage
        Number and times of the samples that were left out.
    """
    kept, dropped_s = dict(tables), list[float]()
    for name, checks in columns.items():
        table = tables.get(name)
        if table is None or table.time_s.size < MIN_SAMPLES:
            continue
        others = (other for key, other in tables.items() if key != name)
        bad = ahead_of_others(table.time_s)
        bad |= _out_of_order(table.time_s) | _displaced(table.time_s, _latest_s(others))
        for column, plausible in checks.items():
            values = table.columns.get(column)
            if values is not None and values.dtype.kind in "iuf":
                bad |= contradicted(values.astype(np.float64), plausible)
        if bad.any():
            dropped_s += _times_of(bad, table.time_s)
            columns_kept = {key: values[~bad] for key, values in table.columns.items()}
            kept[name] = MessageColumns(table.time_s[~bad], columns_kept)
    return kept, FileDamage(contradicted_s=tuple(sorted(dropped_s)))


def contradicted(values: Array, plausible: Plausible) -> NDArray[np.bool_]:
    """Return a mask of samples that both neighbours contradict.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples in order of time.
    plausible : Plausible
        Floor and period of the column.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for a spike of one sample, for a sample without a value between two with one, and for
        an outermost sample that leaves the next ones, which agree.
    """
    mask = np.zeros(values.size, bool)
    if values.size < MIN_SAMPLES:
        return mask
    measured = np.isfinite(values) & (np.abs(values) <= MAX_ABS_VALUE)
    before = _wrapped(values[1:-1] - values[:-2], plausible.period)
    after = _wrapped(values[1:-1] - values[2:], plausible.period)
    across = _wrapped(values[2:] - values[:-2], plausible.period)
    second = np.abs(before + after)
    second = second[np.isfinite(second)]
    noise_sd = MAD_TO_SD * float(np.median(second)) / math.sqrt(6.0) if second.size else 0.0
    spike = np.minimum(np.abs(before), np.abs(after))
    limit = max(plausible.floor, NOISE_RATIO * noise_sd)
    mask[1:-1] = (
        (spike > limit)
        & (np.sign(before) == np.sign(after))
        & (np.abs(across) <= AGREEMENT * spike)
    )
    mask[1:-1] |= ~measured[1:-1] & measured[:-2] & measured[2:]
    mask[0] = _leaves_others(values[:END_SAMPLES], plausible, limit)
    mask[-1] = _leaves_others(values[: -END_SAMPLES - 1 : -1], plausible, limit)
    return mask


def _leaves_others(values: Array, plausible: Plausible, limit: float) -> bool:
    """Return whether the first of some values is beyond ``limit`` from others that agree."""
    spike = abs(float(_wrapped(values[:1] - values[1:2], plausible.period)[0]))
    others = np.abs(_wrapped(values[2:] - values[1], plausible.period))
    return bool(not spike <= limit and np.all(others <= AGREEMENT * limit))


def _out_of_order(time_s: Array) -> NDArray[np.bool_]:
    """Return a mask of samples whose time is not in order, or at an end far from the next one."""
    mask = np.zeros(time_s.size, bool)
    before, now, after = time_s[:-2], time_s[1:-1], time_s[2:]
    mask[1:-1] = (before < after) & ((now < before) | (now > after) | ~np.isfinite(now))
    longest_s = MAX_GAP_PERIODS * float(np.median(np.diff(time_s)))
    mask[0] = not 0.0 <= time_s[1] - time_s[0] <= longest_s
    mask[-1] = not 0.0 <= time_s[-1] - time_s[-2] <= longest_s
    return mask


def _displaced(time_s: Array, latest_s: float) -> NDArray[np.bool_]:
    """Return a mask of samples whose time leaves the regular interval of its neighbours.

    Nor is the last sample later than the last ones of all other messages, after a gap.
    """
    usual_s = float(np.median(np.diff(time_s)))
    regular_s = usual_s * np.arange(time_s.size)
    mask = contradicted(time_s - regular_s, Plausible(MIN_DISPLACEMENT_S))
    mask[0] = False
    mask[-1] = time_s[-1] - max(time_s[-2], latest_s) > GAP_INTERVALS * usual_s
    return mask


def _latest_s(tables: Iterable[MessageColumns]) -> float:
    """Return the time of the last sample of some tables."""
    return max((float(table.time_s[-1]) for table in tables if table.time_s.size), default=math.inf)


def _times_of(bad: NDArray[np.bool_], time_s: Array) -> list[float]:
    """Return the times of samples; that of the sample before, because their own may be wrong."""
    return [float(time_s[index - 1]) for index in np.flatnonzero(bad)]


def _wrapped(difference: Array, period: float) -> Array:
    """Return differences of an angle in half a period to either side."""
    if not period:
        return difference
    wrapped: Array = np.mod(difference + 0.5 * period, period) - 0.5 * period
    return wrapped
