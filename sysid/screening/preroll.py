"""How vehicles come to their tests: what the sea does to one on closed loops, told by the pre-rolls
of all runs."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sysid.data.segments import RATE_HZ, STEADY_S, Array, Plane, Run
from sysid.screening.limits import ScreeningLimits

WINDOW = int(STEADY_S * RATE_HZ)
MIN_WINDOWS = 6
"""Fewer from the other runs, and a spread of them says nothing."""
MAD_TO_SD = 1.4826
"""Standard deviation over median absolute deviation of a normal variable: one bad run leaves it
alone."""


class PrerollWindow(NamedTuple):
    """Mean motion over STEADY_S."""

    rate_radps: float
    climb_mps: float


class UsualPreroll(NamedTuple):
    """What is usual before a test in one plane."""

    rate_radps: float
    """Median of the windows: the gyro's bias."""
    rate_allowed_radps: float
    climb_allowed_mps: float


def last_window(run: Run) -> PrerollWindow | None:
    """The window that ends where the test begins; None with less than a second of it."""
    before = run.approach
    if np.count_nonzero(before) < RATE_HZ:
        return None
    return _window(run.rate_radps[before], run.time_s[before], run.depth_m[before])


def usual_preroll(run: Run, runs: Sequence[Run], limits: ScreeningLimits) -> UsualPreroll:
    """From the pre-rolls of the other runs of either plane: both loops are closed there."""
    windows = [
        window for other in runs if other is not run for window in _windows(other, run.plane)
    ]
    if len(windows) < MIN_WINDOWS:
        return UsualPreroll(0.0, math.radians(limits.mean_rate_degps), limits.start_depth_rate_mps)
    rates, climbs = (np.array(values) for values in zip(*windows, strict=True))
    # A window's mean differs from the median by the sea, and by what a gyro's bias changes from run
    # to run.
    rate = max(limits.start_sds * _spread(rates), math.radians(limits.rate_floor_degps))
    climb = max(limits.start_sds * _spread(climbs), limits.depth_rate_floor_mps)
    return UsualPreroll(float(np.median(rates)), rate, climb)


def roughness_radps(run: Run) -> float:
    """Standard deviation of the rate before the test."""
    return float(np.std(run.rate_radps[run.approach])) if run.approach.any() else 0.0


def typical_roughness_radps(runs: Sequence[Run]) -> float:
    return float(np.median([roughness_radps(run) for run in runs])) if runs else 0.0


def _windows(run: Run, plane: Plane) -> list[PrerollWindow]:
    rate = run.r_radps if plane == "yaw" else run.q_radps
    end = int(np.count_nonzero(run.preroll))
    slices = [slice(stop - WINDOW, stop) for stop in range(end, WINDOW - 1, -WINDOW)]
    return [_window(rate[part], run.time_s[part], run.depth_m[part]) for part in slices]


def _window(rate_radps: Array, time_s: Array, depth_m: Array) -> PrerollWindow:
    return PrerollWindow(float(np.mean(rate_radps)), float(np.polyfit(time_s, depth_m, 1)[0]))


def _spread(values: Array) -> float:
    return MAD_TO_SD * float(np.median(np.abs(values - np.median(values))))
