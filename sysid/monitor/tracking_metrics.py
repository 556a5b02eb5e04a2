"""Tracking errors of a dive after settling: the figures of the paper's Table 5, from a log."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Log
from sysid.data.events import TestStarted
from sysid.data.segments import cut_runs
from sysid.models.json_record import JsonRecord

Array = NDArray[np.float64]

SETTLING_S = 25.0
"""Time (s) that is excluded after each change of set-point.

A depth change of 3 m takes about 10 s and a turn of 80 deg about 15 s, plus the decay of
transients.
"""
MIN_WINDOW_S = 5.0
"""Minimum length of an evaluated window (s)."""
SUBMERGED_M = 0.3
"""Minimum depth set-point of a dive (m)."""
HEADING_CHANGE_RAD = math.radians(0.5)
"""Smallest change of the heading set-point that counts as a new one (rad)."""
DEPTH_CHANGE_M = 0.05
"""Smallest change of the depth set-point that counts as a new one (m)."""


class Spread(JsonRecord, frozen=True):
    """Statistics of an error over a window."""

    p95: float
    """95 % of the samples are within this distance of zero."""
    max: float
    """Largest magnitude."""
    rms: float
    mean: float


class SteadyWindow(JsonRecord, frozen=True):
    """Stretch of constant set-points without its settling time."""

    start_s: float
    stop_s: float
    heading_setpoint_deg: float
    depth_setpoint_m: float
    heading_deg: Spread
    pitch_deg: Spread
    """Pitch about its own mean: the pitch of level flight is not an error."""
    depth_m: Spread


class TrackingMetrics(JsonRecord, frozen=True):
    """Tracking errors of a dive."""

    windows: tuple[SteadyWindow, ...]
    heading_deg: Spread
    """Heading error over all windows."""
    pitch_deg: Spread
    depth_m: Spread
    settling_s: float


class SteadyInterval(NamedTuple):
    """Interval of constant set-points."""

    start_s: float
    stop_s: float
    heading_setpoint_deg: float
    depth_setpoint_m: float


class TrackingErrors(NamedTuple):
    """Errors at the samples of an interval."""

    heading_deg: Array
    pitch_deg: Array
    """Pitch about its own mean."""
    depth_m: Array


def tracking(
    log: Log, settling_s: float = SETTLING_S, shortest_s: float = MIN_WINDOW_S
) -> TrackingMetrics | None:
    """Return the steady-state errors of a dive.

    Parameters
    ----------
    log : Log
        Log of the dive.
    settling_s : float
        Time excluded after each change of set-point (s).
    shortest_s : float
        Minimum length of a window (s).

    Returns
    -------
    TrackingMetrics or None
        None if no stretch outlasts its settling time. Identification tests are excluded.
    """
    found = [
        (interval, errors_in(log, interval.start_s, interval.stop_s))
        for interval in intervals(log, settling_s, shortest_s)
    ]
    if not found:
        return None
    return TrackingMetrics(
        windows=tuple(_window(interval, errors) for interval, errors in found),
        heading_deg=spread(np.concatenate([errors.heading_deg for _, errors in found])),
        pitch_deg=spread(np.concatenate([errors.pitch_deg for _, errors in found])),
        depth_m=spread(np.concatenate([errors.depth_m for _, errors in found])),
        settling_s=settling_s,
    )


def intervals(
    log: Log, settling_s: float = SETTLING_S, shortest_s: float = MIN_WINDOW_S
) -> list[SteadyInterval]:
    """Return the intervals of constant set-points that have samples.

    Parameters
    ----------
    log : Log
        Log of the dive.
    settling_s : float
        Time excluded after each change of set-point (s).
    shortest_s : float
        Minimum length of an interval (s).

    Returns
    -------
    list of SteadyInterval
        The windows of ``tracking``, without their errors.
    """
    return [
        _interval(log, start, stop)
        for start, stop in _steady(log, settling_s, shortest_s)
        if np.any(_in_interval(log.attitude.time_s, start, stop))
        and np.any(_in_interval(log.depth.time_s, start, stop))
    ]


def window(log: Log, start_s: float, stop_s: float) -> SteadyWindow:
    """Return the errors over a part of a window of `tracking`.

    Parameters
    ----------
    log : Log
        Log of the dive.
    start_s, stop_s : float
        Interval (s).

    Returns
    -------
    SteadyWindow
        Errors in this interval.
    """
    return _window(_interval(log, start_s, stop_s), errors_in(log, start_s, stop_s))


def spread(error: Array) -> Spread:
    """Return the statistics of an error."""
    size = np.abs(error)
    return Spread(
        p95=float(np.quantile(size, 0.95)),
        max=float(np.max(size)),
        rms=float(np.sqrt(np.mean(error**2))),
        mean=float(np.mean(error)),
    )


def stretches(log: Log) -> Iterator[tuple[float, float]]:
    """Yield each stretch of constant set-points below the surface, without identification tests.

    Parameters
    ----------
    log : Log
        Log of the dive.

    Yields
    ------
    tuple of float
        Start and stop (s).
    """
    points = log.setpoints
    if points.attitude_time_s.size == 0 or points.depth_time_s.size == 0:
        return
    changes = [
        *_changes(points.attitude_time_s, points.heading_rad, HEADING_CHANGE_RAD),
        *_changes(points.depth_time_s, points.depth_m, DEPTH_CHANGE_M),
    ]
    tests = _tests(log)
    edges = sorted(
        {*changes, *(edge for test in tests for edge in test), float(log.attitude.time_s[-1])}
    )
    for start, stop in pairwise(edges):
        in_test = any(begin <= start < end for begin, end in tests)
        middle = 0.5 * (start + stop)
        if not in_test and _value_at(points.depth_time_s, points.depth_m, middle) > SUBMERGED_M:
            yield start, stop


def _steady(log: Log, settling_s: float, shortest_s: float) -> Iterator[tuple[float, float]]:
    """Yield start and stop (s) of each stretch after settling."""
    for start, stop in stretches(log):
        settled = start + settling_s
        if stop - settled >= shortest_s:
            yield settled, stop


def _changes(time_s: Array, values: Array, min_change: float) -> list[float]:
    """Return the times of the first sample and of every sample that differs from the last."""
    indices = np.flatnonzero(np.abs(np.diff(values)) > min_change) + 1
    return [float(time_s[0]), *time_s[indices].tolist()]


def _tests(log: Log) -> Sequence[tuple[float, float]]:
    """Return start and stop (s) of each identification test."""
    starts = [event.time_s for event in log.events if isinstance(event.value, TestStarted)]
    return [
        (start, start + float(run.time_s[-1]))
        for start, run in zip(starts, cut_runs(log), strict=False)
    ]


def _value_at(time_s: Array, values: Array, at_s: float) -> float:
    """Return the latest value at a time."""
    return float(values[max(0, int(np.searchsorted(time_s, at_s, side="right")) - 1)])


def _followed(
    time_s: Array,
    values: Array,
    at_s: Array,
    limit: float,
    start_s: float,
) -> Array | float:
    """Return the set-point at `at_s`; the one at `start_s` unless it changes by `limit`.

    Path following turns the heading set-point in steps too small to count as changes.
    """
    start = _value_at(time_s, values, start_s)
    if at_s.size == 0:
        return start
    rows = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, None)
    setpoints = values[rows]
    return setpoints if np.max(np.abs(setpoints - start)) > limit else start


def _in_interval(time_s: Array, start_s: float, stop_s: float) -> NDArray[np.bool_]:
    """Return a mask of the samples in an interval."""
    return (time_s >= start_s) & (time_s < stop_s)


def errors_in(log: Log, start_s: float, stop_s: float) -> TrackingErrors:
    """Return the errors in an interval of constant set-points.

    Parameters
    ----------
    log : Log
        Log of the dive.
    start_s, stop_s : float
        Interval (s).

    Returns
    -------
    TrackingErrors
        Errors at its samples.
    """
    attitude, depth, points = log.attitude, log.depth, log.setpoints
    in_window = _in_interval(attitude.time_s, start_s, stop_s)
    depth_in_window = _in_interval(depth.time_s, start_s, stop_s)
    yaw_time_s, depth_time_s = attitude.time_s[in_window], depth.time_s[depth_in_window]
    headings = points.attitude_time_s, points.heading_rad
    depths = points.depth_time_s, points.depth_m
    depth_setpoint_m = _followed(*depths, depth_time_s, DEPTH_CHANGE_M, start_s)
    heading = attitude.yaw_rad[in_window] - _followed(
        *headings, yaw_time_s, HEADING_CHANGE_RAD, start_s
    )
    wrapped = (heading + math.pi) % (2.0 * math.pi) - math.pi
    pitch = attitude.pitch_rad[in_window]
    return TrackingErrors(
        heading_deg=np.degrees(wrapped),
        pitch_deg=np.degrees(pitch - np.mean(pitch)),
        depth_m=depth.depth_m[depth_in_window] - depth_setpoint_m,
    )


def _interval(log: Log, start_s: float, stop_s: float) -> SteadyInterval:
    """Return an interval with the set-points at its start."""
    points = log.setpoints
    heading_rad = _value_at(points.attitude_time_s, points.heading_rad, start_s)
    depth_m = _value_at(points.depth_time_s, points.depth_m, start_s)
    return SteadyInterval(start_s, stop_s, math.degrees(heading_rad) % 360.0, depth_m)


def _window(interval: SteadyInterval, errors: TrackingErrors) -> SteadyWindow:
    """Return the statistics of a window."""
    return SteadyWindow(
        start_s=interval.start_s,
        stop_s=interval.stop_s,
        heading_setpoint_deg=interval.heading_setpoint_deg,
        depth_setpoint_m=round(interval.depth_setpoint_m, 3),  # telemetry has single precision
        heading_deg=spread(errors.heading_deg),
        pitch_deg=spread(errors.pitch_deg),
        depth_m=spread(errors.depth_m),
    )
