"""Finds logs that hold the same dive: the same file, a copy, or its samples in another file.

A model that is judged by data it was fitted to is judged too well, and data that are fitted twice
make its intervals too narrow by up to a factor of sqrt(2).
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
"""Number of different samples of attitude in tests of two logs that shows them to be one dive.

Half a second at the autopilot's tick, 5 s at the lowest rate that screening accepts. Sensor noise
moves the six values of a sample by many steps of ``RESOLUTION``: two dives share none.
"""
RESOLUTION = 1e-5
"""Step in rad and rad/s to which samples are compared: coarser than float32, finer than noise."""


class NamedLog(NamedTuple):
    """A log and the path under which it was given."""

    path: str | Path
    log: Log
    samples: frozenset[bytes]
    """Samples of attitude within tests."""


def named_log(path: str | Path, log: Log, marks: Sequence[MarkedInterval]) -> NamedLog:
    """A log as `refusal` compares it; ``marks`` are the tests that it does not tell of itself."""
    return NamedLog(path, log, _samples(log, marks))


def refusal(
    fitted: Sequence[NamedLog],
    held_out: Sequence[NamedLog],
    prior_data: Sequence[DataFile] = (),
) -> str:
    """Why logs cannot be used together, in one line; empty where they can.

    Parameters
    ----------
    fitted, held_out
        The logs to fit, and those to predict.
    prior_data
        What the prior was fitted to, if it is a model: it counts as fitted.
    """
    for one, other in combinations(fitted, 2):
        if _is_same(one, other):
            return (
                f"{one.path} and {other.path} hold the same samples: fitted twice, they would make "
                "the intervals too narrow; give one of them"
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
                f"{one.path} and {other.path}, held out, hold the same samples: judged twice, they "
                "would count double; give one of them"
            )
    return _refusal_by_prior((*fitted, *held_out), prior_data)


def _refusal_by_prior(given: Iterable[NamedLog], prior_data: Sequence[DataFile]) -> str:
    known = {data.sha256: data.name for data in prior_data}
    for one in given:
        if one.log.sha256 in known:
            return (
                f"{one.path}: the model that is the prior was fitted to it already, as "
                f"{known[one.log.sha256]}; give another dive, or another prior"
            )
    return ""


def _is_same(one: NamedLog, other: NamedLog) -> bool:
    if one.log.sha256 == other.log.sha256:
        return True
    return len(one.samples & other.samples) >= MIN_SHARED_SAMPLES


def _samples(log: Log, marks: Sequence[MarkedInterval]) -> frozenset[bytes]:
    """Every different sample of attitude within tests, without its time: copies may shift that."""
    a = log.attitude
    inside = np.zeros(a.time_s.size, bool)
    for start_s, stop_s in times_of_tests(log, marks):
        inside |= (a.time_s >= start_s) & (a.time_s <= stop_s)
    yaw_rad = np.mod(a.yaw_rad, 2.0 * np.pi)
    values = (a.roll_rad, a.pitch_rad, yaw_rad, a.p_radps, a.q_radps, a.r_radps)
    table = np.stack(values, axis=1)[inside]
    steps = np.round(table[np.isfinite(table).all(axis=1)] / RESOLUTION).astype(np.int64)
    return frozenset(row.tobytes() for row in steps)
