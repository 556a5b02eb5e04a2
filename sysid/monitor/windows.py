"""Windows of steady flight: constant set-points after settling, no test active."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Log
from sysid.data.events import TestEnded, TestStarted
from sysid.monitor.performance_spec import AVERAGED_S, RESONANCE_BANDWIDTH, PerformanceBaseline
from sysid.monitor.tracking_metrics import (
    DEPTH_CHANGE_M,
    HEADING_CHANGE_RAD,
    SETTLING_S,
)
from sysid.signal_processing import filter_recursively, resonance

Array = NDArray[np.float64]

STEP_S = 0.2
"""Sample interval of monitoring (s)."""
STALE_S = 1.0
"""Age beyond which telemetry is no longer used (s)."""
NEAR_SURFACE_M = 2.0
"""Minimum depth set-point (m).

Nearer to the surface, waves and suction differ from those of the tests, and suction has the same
effect as buoyancy.
"""
SETTLED_RAD, SETTLED_M = math.radians(8.0), 0.5
"""Largest heading and depth error at which a new set-point counts as reached.

Before that the vehicle is in transit; afterwards all errors are evaluated.
"""


class MotionRow(NamedTuple):
    """State of the vehicle at one time; NaN where no recent telemetry exists."""

    time_s: float
    heading_rad: float
    pitch_rad: float
    depth_m: float
    rudder_rad: float
    elevator_rad: float
    thrust: float
    heading_setpoint_rad: float
    depth_setpoint_m: float
    testing: bool

    @property
    def known(self) -> bool:
        """Whether all values are available."""
        return not any(math.isnan(value) for value in self)


class MonitorWindow(NamedTuple):
    """Statistics of ``AVERAGED_S`` of steady flight."""

    start_s: float
    stop_s: float
    thrust: float
    means: dict[str, float]
    variances: dict[str, float]
    """Variances about the window's own mean."""


def sample(log: Log, after_s: float | None, until_s: float) -> list[MotionRow]:
    """Return a log sampled every ``STEP_S``, after `after_s` up to `until_s` (s)."""
    first_s = float(log.attitude.time_s[0]) if after_s is None else after_s
    ticks = range(math.floor(first_s / STEP_S + 1e-6) + 1, math.floor(until_s / STEP_S + 1e-6) + 1)
    time_s: Array = STEP_S * np.array(ticks, dtype=np.float64)
    attitude, actuators, depth, points = log.attitude, log.actuators, log.depth, log.setpoints
    columns = (
        time_s,
        _latest(time_s, attitude.time_s, attitude.yaw_rad),
        _latest(time_s, attitude.time_s, attitude.pitch_rad),
        _latest(time_s, depth.time_s, depth.depth_m),
        _latest(time_s, actuators.time_s, actuators.rudder_rad),
        _latest(time_s, actuators.time_s, actuators.elevator_rad),
        _latest(time_s, actuators.time_s, actuators.thrust),
        _latest(time_s, points.attitude_time_s, points.heading_rad),
        _latest(time_s, points.depth_time_s, points.depth_m),
    )
    rows = zip(
        *(column.tolist() for column in columns), _test_running(log, time_s).tolist(), strict=True
    )
    return [MotionRow(*row) for row in rows]


class WindowCutter:
    """Cutter that takes rows in order of time and yields windows as they fill."""

    def __init__(self, baseline: PerformanceBaseline) -> None:
        self._bands = {
            "heading": resonance(baseline.heading_resonance_radps, RESONANCE_BANDWIDTH, STEP_S),
            "pitch": resonance(baseline.pitch_resonance_radps, RESONANCE_BANDWIDTH, STEP_S),
        }
        self._rows: list[MotionRow] = []

    def take(self, rows: Sequence[MotionRow]) -> Iterator[MonitorWindow]:
        """Yield the windows that the rows complete."""
        settling_rows, window_rows = round(SETTLING_S / STEP_S), round(AVERAGED_S / STEP_S)
        for row in rows:
            if not _continues(self._rows, row):
                self._rows = []
            if _is_steady(row) and (self._rows or _is_settled(row)):
                self._rows.append(row)
            if len(self._rows) == settling_rows + window_rows:
                yield self._window(self._rows, window_rows)
                self._rows = self._rows[window_rows:]

    def _window(self, rows: Sequence[MotionRow], window_rows: int) -> MonitorWindow:
        """Return the statistics of the last rows; the earlier rows let the band filters settle."""
        heading = np.degrees(
            np.unwrap([row.heading_rad - row.heading_setpoint_rad for row in rows])
        )
        heading -= 360.0 * np.round(np.mean(heading) / 360.0)
        pitch = np.degrees([row.pitch_rad for row in rows])
        series = {
            "heading_deg": heading,
            "heading_resonance_deg": self._in_band("heading", heading),
            "pitch_deg": pitch,
            "pitch_resonance_deg": self._in_band("pitch", pitch),
            "depth_m": np.array([row.depth_m - row.depth_setpoint_m for row in rows]),
            "rudder_deg": np.degrees([row.rudder_rad for row in rows]),
            "elevator_deg": np.degrees([row.elevator_rad for row in rows]),
        }
        window_series = {name: np.asarray(values[-window_rows:]) for name, values in series.items()}
        return MonitorWindow(
            start_s=rows[-window_rows].time_s - STEP_S,
            stop_s=rows[-1].time_s,
            thrust=float(np.mean([row.thrust for row in rows[-window_rows:]])),
            means={name: float(np.mean(values)) for name, values in window_series.items()},
            variances={name: float(np.var(values)) for name, values in window_series.items()},
        )

    def _in_band(self, plane: str, values: Array) -> Array:
        """Return a signal without its mean, filtered by the resonance filter of a plane."""
        numerator, denominator = self._bands[plane]
        return filter_recursively(numerator, denominator, values - np.mean(values), np.zeros(2))


def _latest(at_s: Array, time_s: Array, values: Array) -> Array:
    """Return the latest value before each time; NaN if it is older than `STALE_S`."""
    if not time_s.size:
        return np.full(at_s.size, math.nan)
    indices = np.searchsorted(time_s, at_s, side="right") - 1
    latest = values[np.maximum(indices, 0)]
    fresh = (indices >= 0) & (at_s - time_s[np.maximum(indices, 0)] <= STALE_S)
    return np.where(fresh, latest, math.nan)


def _test_running(log: Log, at_s: Array) -> NDArray[np.bool_]:
    """Return a mask of the times at which a test is active."""
    testing = np.zeros(at_s.size, dtype=np.bool_)
    for time_s, event in log.events:
        if isinstance(event, TestStarted):
            testing |= at_s >= time_s
        elif isinstance(event, TestEnded):
            testing &= at_s < time_s
    return testing


def _continues(rows: Sequence[MotionRow], row: MotionRow) -> bool:
    """Return whether a row has the same set-points as the rows before it, without a gap."""
    if not rows:
        return True
    first_row = rows[0]
    return (
        row.time_s - rows[-1].time_s < 1.5 * STEP_S
        and _angle_difference(row.heading_setpoint_rad, first_row.heading_setpoint_rad)
        <= HEADING_CHANGE_RAD
        and abs(row.depth_setpoint_m - first_row.depth_setpoint_m) <= DEPTH_CHANGE_M
        and _is_steady(row)
    )


def _is_steady(row: MotionRow) -> bool:
    """Return whether the row is complete, below the surface layer and without a test."""
    return row.known and not row.testing and row.depth_setpoint_m >= NEAR_SURFACE_M


def _is_settled(row: MotionRow) -> bool:
    """Return whether the vehicle has reached its set-points."""
    near = _angle_difference(row.heading_rad, row.heading_setpoint_rad) <= SETTLED_RAD
    return near and abs(row.depth_m - row.depth_setpoint_m) <= SETTLED_M


def _angle_difference(first_rad: float, second_rad: float) -> float:
    """Return the absolute difference of two angles (rad)."""
    return abs(math.remainder(first_rad - second_rad, 2.0 * math.pi))
