"""How well a dive held its set-points once settled: the figures of the paper's Table 5, from a
log."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Log
from sysid.data.segments import START_TEXT, cut_runs

Array = NDArray[np.float64]

SETTLING_S = 25.0
"""After each change of set-point, left out: a 3 m depth change takes about 10 s, an 80 deg turn
about 15, and ringing out."""
MIN_WINDOW_S = 5.0
SUBMERGED_M = 0.3
"""Set-points shallower than this are no dive."""
HEADING_CHANGE_RAD = math.radians(0.5)
DEPTH_CHANGE_M = 0.05


class Spread(NamedTuple):
    """Size of an error over a window."""

    p95: float
    """95 % of the samples are within this of zero."""
    largest: float
    rms: float
    mean: float


class SteadyWindow(NamedTuple):
    """One stretch of constant set-points, its settling left out."""

    start_s: float
    stop_s: float
    heading_setpoint_deg: float
    depth_setpoint_m: float
    heading_deg: Spread
    pitch_deg: Spread
    """About its own mean: the pitch of level flight is physics, not an error."""
    depth_m: Spread


class TrackingMetrics(NamedTuple):
    windows: tuple[SteadyWindow, ...]
    heading_deg: Spread
    """Over all windows together."""
    pitch_deg: Spread
    depth_m: Spread
    settling_s: float


class _Errors(NamedTuple):
    heading_deg: Array
    pitch_deg: Array
    depth_m: Array


def tracking(
    log: Log, settling_s: float = SETTLING_S, shortest_s: float = MIN_WINDOW_S
) -> TrackingMetrics | None:
    """Steady errors of a dive; None when no stretch outlasts its settling. Tests in the water are
    left out."""
    found = [(window, _errors(log, *window)) for window in _steady(log, settling_s, shortest_s)]
    if not found:
        return None
    windows = tuple(_window(log, start, stop, errors) for (start, stop), errors in found)
    return TrackingMetrics(
        windows=windows,
        heading_deg=spread(np.concatenate([errors.heading_deg for _, errors in found])),
        pitch_deg=spread(np.concatenate([errors.pitch_deg for _, errors in found])),
        depth_m=spread(np.concatenate([errors.depth_m for _, errors in found])),
        settling_s=settling_s,
    )


def spread(error: Array) -> Spread:
    size = np.abs(error)
    return Spread(
        p95=float(np.quantile(size, 0.95)),
        largest=float(np.max(size)),
        rms=float(np.sqrt(np.mean(error**2))),
        mean=float(np.mean(error)),
    )


def _steady(log: Log, settling_s: float, shortest_s: float) -> Iterator[tuple[float, float]]:
    """(start, stop) of stretches of unchanged set-points under water, after settling."""
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
        settled = start + settling_s
        in_test = any(begin <= start < end for begin, end in tests)
        submerged = _value_at(points.depth_time_s, points.depth_m, settled) > SUBMERGED_M
        if stop - settled >= shortest_s and submerged and not in_test:
            yield settled, stop


def _changes(time_s: Array, values: Array, least: float) -> list[float]:
    """The first sample, and every one that differs from the sample before it."""
    moved = np.flatnonzero(np.abs(np.diff(values)) > least) + 1
    return [float(time_s[0]), *time_s[moved].tolist()]


def _tests(log: Log) -> Sequence[tuple[float, float]]:
    starts = [event.time_s for event in log.events if START_TEXT in event.text]
    return [
        (start, start + float(run.time_s[-1]))
        for start, run in zip(starts, cut_runs(log), strict=False)
    ]


def _value_at(time_s: Array, values: Array, at_s: float) -> float:
    return float(values[max(0, int(np.searchsorted(time_s, at_s, side="right")) - 1)])


def _errors(log: Log, start_s: float, stop_s: float) -> _Errors:
    attitude, depth, points = log.attitude, log.depth, log.setpoints
    now = (attitude.time_s >= start_s) & (attitude.time_s < stop_s)
    deep = (depth.time_s >= start_s) & (depth.time_s < stop_s)
    heading = attitude.yaw_rad[now] - _value_at(points.attitude_time_s, points.heading_rad, start_s)
    wrapped = (heading + math.pi) % (2.0 * math.pi) - math.pi
    pitch = attitude.pitch_rad[now]
    return _Errors(
        heading_deg=np.degrees(wrapped),
        pitch_deg=np.degrees(pitch - np.mean(pitch)),
        depth_m=depth.depth_m[deep] - _value_at(points.depth_time_s, points.depth_m, start_s),
    )


def _window(log: Log, start_s: float, stop_s: float, errors: _Errors) -> SteadyWindow:
    points = log.setpoints
    return SteadyWindow(
        start_s=start_s,
        stop_s=stop_s,
        heading_setpoint_deg=math.degrees(
            _value_at(points.attitude_time_s, points.heading_rad, start_s)
        )
        % 360.0,
        depth_setpoint_m=_value_at(points.depth_time_s, points.depth_m, start_s),
        heading_deg=spread(errors.heading_deg),
        pitch_deg=spread(errors.pitch_deg),
        depth_m=spread(errors.depth_m),
    )
