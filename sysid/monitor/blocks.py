"""Steady flight cut into blocks: set-points that stay, the settling after their change left out, no
test under way."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import iirpeak, lfilter

from sysid.data.dataset import Log
from sysid.data.segments import END_TEXTS, START_TEXT
from sysid.monitor.performance_spec import AVERAGED_S, RESONANCE_BANDWIDTH, PerformanceBaseline
from sysid.monitor.tracking_metrics import (
    DEPTH_CHANGE_M,
    HEADING_CHANGE_RAD,
    SETTLING_S,
)

Array = NDArray[np.float64]

STEP_S = 0.2
STALE_S = 1.0
"""Older than this nothing is known."""
NEAR_SURFACE_M = 2.0
"""Less deep, waves and suction are not those of the tests, and suction looks like buoyancy."""
SETTLED_RAD, SETTLED_M = math.radians(8.0), 0.5
"""She is on her way to new set-points until she has been so near; from then on every error
counts."""


class MotionRow(NamedTuple):
    """The vehicle at one moment; not a number where nothing was told of late."""

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
        return not any(math.isnan(value) for value in self)


class Block(NamedTuple):
    """``AVERAGED_S`` of steady flight."""

    start_s: float
    stop_s: float
    thrust: float
    means: dict[str, float]
    variances: dict[str, float]
    """About the block's own mean."""


def sample(log: Log, after_s: float | None, until_s: float) -> list[MotionRow]:
    """A log every ``STEP_S`` of vehicle time."""
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


class BlockCutter:
    """Takes rows in order of time, gives blocks as they fill."""

    def __init__(self, promise: PerformanceBaseline) -> None:
        self._bands = {
            "heading": _band(promise.heading_swing_radps),
            "pitch": _band(promise.pitch_swing_radps),
        }
        self._rows: list[MotionRow] = []

    def take(self, rows: Sequence[MotionRow]) -> Iterator[Block]:
        settling, whole = round(SETTLING_S / STEP_S), round(AVERAGED_S / STEP_S)
        for row in rows:
            if not _continues(self._rows, row):
                self._rows = []
            if _is_steady(row) and (self._rows or _is_settled(row)):
                self._rows.append(row)
            if len(self._rows) == settling + whole:
                yield self._block(self._rows, whole)
                self._rows = self._rows[whole:]

    def _block(self, rows: Sequence[MotionRow], whole: int) -> Block:
        """Of the last rows; those before let the narrow bands come to rest."""
        heading = np.degrees(
            np.unwrap([row.heading_rad - row.heading_setpoint_rad for row in rows])
        )
        heading -= 360.0 * np.round(np.mean(heading) / 360.0)
        pitch = np.degrees([row.pitch_rad for row in rows])
        told = {
            "heading_deg": heading,
            "heading_swing_deg": lfilter(*self._bands["heading"], heading - np.mean(heading)),
            "pitch_deg": pitch,
            "pitch_swing_deg": lfilter(*self._bands["pitch"], pitch - np.mean(pitch)),
            "depth_m": np.array([row.depth_m - row.depth_setpoint_m for row in rows]),
            "rudder_deg": np.degrees([row.rudder_rad for row in rows]),
            "elevator_deg": np.degrees([row.elevator_rad for row in rows]),
        }
        last = {name: np.asarray(values[-whole:]) for name, values in told.items()}
        return Block(
            start_s=rows[-whole].time_s - STEP_S,
            stop_s=rows[-1].time_s,
            thrust=float(np.mean([row.thrust for row in rows[-whole:]])),
            means={name: float(np.mean(values)) for name, values in last.items()},
            variances={name: float(np.var(values)) for name, values in last.items()},
        )


def _band(radps: float) -> tuple[Array, Array]:
    numerator, denominator = iirpeak(radps, 1.0 / RESONANCE_BANDWIDTH, fs=2.0 * math.pi / STEP_S)
    return numerator, denominator


def _latest(at_s: Array, time_s: Array, values: Array) -> Array:
    """The value told last before each moment."""
    if not time_s.size:
        return np.full(at_s.size, math.nan)
    last = np.searchsorted(time_s, at_s, side="right") - 1
    found = values[np.maximum(last, 0)]
    fresh = (last >= 0) & (at_s - time_s[np.maximum(last, 0)] <= STALE_S)
    return np.where(fresh, found, math.nan)


def _test_running(log: Log, at_s: Array) -> NDArray[np.bool_]:
    testing = np.zeros(at_s.size, dtype=np.bool_)
    for event in log.events:
        if event.text.startswith(START_TEXT):
            testing |= at_s >= event.time_s
        elif event.text.startswith(END_TEXTS):
            testing &= at_s < event.time_s
    return testing


def _continues(rows: Sequence[MotionRow], row: MotionRow) -> bool:
    """Whether a row is flown as those before it."""
    if not rows:
        return True
    first = rows[0]
    return (
        row.time_s - rows[-1].time_s < 1.5 * STEP_S
        and _angle_difference(row.heading_setpoint_rad, first.heading_setpoint_rad)
        <= HEADING_CHANGE_RAD
        and abs(row.depth_setpoint_m - first.depth_setpoint_m) <= DEPTH_CHANGE_M
        and _is_steady(row)
    )


def _is_steady(row: MotionRow) -> bool:
    return row.known and not row.testing and row.depth_setpoint_m >= NEAR_SURFACE_M


def _is_settled(row: MotionRow) -> bool:
    near = _angle_difference(row.heading_rad, row.heading_setpoint_rad) <= SETTLED_RAD
    return near and abs(row.depth_m - row.depth_setpoint_m) <= SETTLED_M


def _angle_difference(one: float, other: float) -> float:
    return abs(math.remainder(one - other, 2.0 * math.pi))
