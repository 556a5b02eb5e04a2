"""Find logs of the same dive: the same file, a copy, or its samples in another file.

Validation with data that were used for the fit is too optimistic, and data that are fitted twice
make the confidence intervals too narrow by up to a factor of sqrt(2).
"""

from collections.abc import Iterable, Sequence
from itertools import combinations, product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sysid.data.dataset import Log
from sysid.data.segments import MarkedInterval, times_of_tests
from sysid.models.model_file import DataFile

MIN_SHARED_SAMPLES = 25
"""Number of equal attitude samples in the tests of two logs from which on they are one dive.

This is 0.5 s at the autopilot's tick, and 5 s at the lowest rate that screening accepts. Sensor
noise changes the four values of a sample by many steps of ``RESOLUTION``, so that different dives
have no equal samples.
"""
RESOLUTION = 1e-5
"""Step in rad and rad/s for the comparison of samples: coarser than float32, finer than noise."""


class NamedLog(NamedTuple):
    """Log with the path that the user gave."""

    path: str | Path
    log: Log
    samples: frozenset[bytes]
    """Attitude samples within tests, in steps of ``RESOLUTION``."""


def named_log(path: str | Path, log: Log, marks: Sequence[MarkedInterval]) -> NamedLog:
    """Return a log for `refusal`.

    Parameters
    ----------
    path : str or Path
        Path that the user gave, for messages.
    log : Log
        The log.
    marks : sequence of MarkedInterval
        Time ranges of tests without texts in the log.

    Returns
    -------
    NamedLog
        The log with its samples.
    """
    return NamedLog(path, log, _samples(log, marks))


def refusal(
    fitted: Sequence[NamedLog],
    held_out: Sequence[NamedLog],
    prior_data: Sequence[DataFile] = (),
) -> str:
    """Return the reason why logs cannot be used together.

    Parameters
    ----------
    fitted : sequence of NamedLog
        Logs for the fit.
    held_out : sequence of NamedLog
        Logs for validation.
    prior_data : sequence of DataFile
        Logs to which the prior was fitted, if it is a model.

    Returns
    -------
    str
        One line; empty if the logs can be used together.
    """
    for one, other in combinations(fitted, 2):
        if _is_same(one, other):
            return (
                f"{one.path} and {other.path} hold the same samples: data that are fitted twice "
                "make the intervals too narrow; give one of them"
            )
    for one, other in product(held_out, fitted):
        if _is_same(one, other):
            return (
                f"{one.path}, held out, holds the same samples as {other.path}, which is fitted: "
                "hold out another dive, or do not fit this one"
            )
    for one, other in combinations(held_out, 2):
        if _is_same(one, other):
            return (
                f"{one.path} and {other.path}, held out, hold the same samples: they would count "
                "twice in the validation; give one of them"
            )
    return _refusal_by_prior((*fitted, *held_out), prior_data)


def _refusal_by_prior(given: Iterable[NamedLog], prior_data: Sequence[DataFile]) -> str:
    """Return the reason if the prior was fitted to one of the logs, else an empty text."""
    known = {data.sha256: data.name for data in prior_data}
    for one in given:
        if one.log.sha256 in known:
            return (
                f"{one.path}: the prior model was already fitted to it, as "
                f"{known[one.log.sha256]}; give another dive, or another prior"
            )
    return ""


def _is_same(one: NamedLog, other: NamedLog) -> bool:
    """Return True if two logs are of the same dive."""
    if one.log.sha256 == other.log.sha256:
        return True
    return len(one.samples & other.samples) >= MIN_SHARED_SAMPLES


def _samples(log: Log, marks: Sequence[MarkedInterval]) -> frozenset[bytes]:
    """Return the different attitude samples within tests, without time, which copies may shift."""
    a = log.attitude
    in_test = np.zeros(a.time_s.size, bool)
    for start_s, stop_s in times_of_tests(log, marks):
        in_test |= (a.time_s >= start_s) & (a.time_s <= stop_s)
    yaw_rad = np.mod(a.yaw_rad, 2.0 * np.pi)
    values = (a.pitch_rad, yaw_rad, a.q_radps, a.r_radps)  # a table may have no roll
    table = np.stack(values, axis=1)[in_test]
    steps = np.round(table[np.isfinite(table).all(axis=1)] / RESOLUTION).astype(np.int64)
    return frozenset(row.tobytes() for row in steps)
