"""Find logs of the same dive: the same file, a copy, its samples or its motion in another file.

Validation with data that were used for the fit is too optimistic, and data that are fitted twice
make the confidence intervals too narrow by up to a factor of sqrt(2).

A copy at another rate, or by another clock, has no equal samples. Its motion is the same also where
only disturbance and noise move the vehicle; a repeated test has the same commands and another
disturbance. Pitch and yaw rate are therefore compared in the quietest windows of both logs.
"""

from collections.abc import Iterable, Sequence
from itertools import combinations, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from sysid.data.dataset import Array, Log
from sysid.data.segments import MarkedInterval, times_of_tests
from sysid.models.model_file import DataFile

MIN_SHARED_SAMPLES = 25
"""Number of equal attitude samples in the tests of two logs from which on they are one dive.

This is 0.5 s at the autopilot's tick, and 5 s at the lowest rate that screening accepts. Sensor
noise changes the four values of a sample by many steps of ``RESOLUTION``, so that different dives
have no equal samples.
"""
MIN_SHARED_SHARE = 0.03
"""Share of the shorter log's samples that are equal from which on two logs are one dive.

Without noise and sea all tests begin alike: up to 2.3 % of the samples of different tests are
equal, rounded to 0.01 deg. One test of thirty is 3 %.
"""
RESOLUTION = 1e-5
"""Step in rad and rad/s for the comparison of samples: coarser than float32, finer than noise."""


STEP_S, BLOCK = 0.05, 4
"""Step in which the shift of two clocks is found, and number of steps whose mean is compared.

Blocks of 0.2 s are longer than the interval of a log of 5 Hz."""
MAX_COMPARED_S = 86_400.0
"""Longest part of a log that is compared, s: a damaged clock may leave a gap of weeks."""
WINDOW_BLOCKS, MIN_WINDOWS, QUIET_SHARE = 25, 6, 0.25
"""Length of a window (5 s), least number of windows, and share of them that counts as quiet."""
MIN_CORRELATION = 0.9
"""Median correlation in the quiet windows, of both rates, from which on two logs are one dive.

Simulated dives with tests, three of each mission in a disturbed and a calm sea: 36 copies at 5 to
50 Hz in the disturbed sea have at least 0.97; of 630 pairs of different dives and 11,808 pairs of
pieces of 30 to 120 s, two thirds of them at the same times of a repeated mission, none has 0.9 in
both rates. In calm water only noise is left, and interpolation changes it: copies at 50 Hz have
0.97, at 5 Hz 0.3, and are not found.
"""


class NamedLog(NamedTuple):
    """Log with the path that the user gave."""

    path: str | Path
    log: Log
    samples: frozenset[bytes]
    """Attitude samples within tests, in steps of ``RESOLUTION``."""
    rates_radps: Array
    """Pitch and yaw rate of the whole log, means over ``STEP_S``, shape (2, n)."""


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
    return NamedLog(path, log, _samples(log, marks), _rates(log))


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
        if shared := _shared(one, other):
            return (
                f"{one.path} and {other.path} hold {shared}: data that are fitted twice "
                "make the intervals too narrow; give one of them"
            )
    for one, other in product(held_out, fitted):
        if shared := _shared(one, other):
            return (
                f"{one.path}, held out, holds {shared} as {other.path}, which is fitted: "
                "hold out another dive, or do not fit this one"
            )
    for one, other in combinations(held_out, 2):
        if shared := _shared(one, other):
            return (
                f"{one.path} and {other.path}, held out, hold {shared}: they would count "
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


def _shared(one: NamedLog, other: NamedLog) -> str:
    """Return what two logs of the same dive share; empty for different dives."""
    if one.log.sha256 == other.log.sha256:
        return "the same samples"
    shared, smaller = len(one.samples & other.samples), min(len(one.samples), len(other.samples))
    if shared >= max(MIN_SHARED_SAMPLES, MIN_SHARED_SHARE * smaller):
        return "the same samples"
    return "the same motion" if _moves_alike(one.rates_radps, other.rates_radps) else ""


def _moves_alike(one: Array, other: Array) -> bool:
    """Return whether both rates of two logs correlate also where the vehicle is hardly moved."""
    shift = _shift(one, other)
    one, other = one[:, max(0, shift) :], other[:, max(0, -shift) :]
    length = WINDOW_BLOCKS * BLOCK
    windows = min(one.shape[1], other.shape[1]) // length
    if windows < MIN_WINDOWS:
        return False
    x, y = (
        rates[:, : windows * length].reshape(2, windows, WINDOW_BLOCKS, BLOCK).mean(axis=3)
        for rates in (one, other)
    )
    x, y = (rates - rates.mean(axis=2, keepdims=True) for rates in (x, y))
    power_x, power_y = (np.sum(rates**2, axis=2) for rates in (x, y))
    with np.errstate(invalid="ignore"):
        correlation = np.nan_to_num(np.sum(x * y, axis=2) / np.sqrt(power_x * power_y))
    quiet = np.argsort(power_x + power_y, axis=1)[:, : max(2, round(QUIET_SHARE * windows))]
    medians = np.median(np.take_along_axis(correlation, quiet, axis=1), axis=1)
    return bool(np.all(medians > MIN_CORRELATION))


def _shift(one: Array, other: Array) -> int:
    """Return the number of steps by which ``one`` is later, where the correlation is largest."""
    steps = one.shape[1] + other.shape[1]
    spectra = (
        np.fft.rfft(rates - rates.mean(axis=1, keepdims=True), steps) for rates in (one, other)
    )
    first, second = spectra
    correlation = np.fft.irfft(np.sum(first * second.conj(), axis=0), steps)
    shift = int(np.argmax(correlation))
    return shift if shift < one.shape[1] else shift - steps


def _rates(log: Log) -> Array:
    """Return pitch and yaw rate of a log as means over ``STEP_S``."""
    a = log.attitude
    known = np.isfinite(a.q_radps) & np.isfinite(a.r_radps)
    time_s = a.time_s[known]
    if time_s.size < 2:
        return np.zeros((2, 1))
    grid_s = np.arange(time_s[0], min(time_s[-1], time_s[0] + MAX_COMPARED_S), STEP_S)
    rows = [
        np.diff(np.interp(grid_s, time_s, cumulative_trapezoid(rate[known], time_s, initial=0.0)))
        for rate in (a.q_radps, a.r_radps)
    ]
    return np.array(rows) / STEP_S


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
