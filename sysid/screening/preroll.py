"""Motion before a test: its usual range is estimated from the pre-rolls of all runs.

In a pre-roll both loops are closed, so that its motion shows the disturbance and the gyro bias.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sysid.data.runs import RATE_HZ, STEADY_S, Array, Run
from sysid.planes import Plane
from sysid.signal_processing import MAD_TO_SD, fit_line

WINDOW = int(STEADY_S * RATE_HZ)
"""Length of a window, samples."""
MIN_WINDOWS = 6
"""Minimum number of windows of the other runs from which a spread is estimated."""
MAX_SHARE_AT_STOPS = 0.2
"""Share of a window with the surface at its stops above which the hold is unstable.

A wave reaches them for a moment; a limit cycle spends most of its time there.
"""
STOP_TOLERANCE_RAD = 1e-4
"""Distance to the travel at which a surface is at its stop: rounding of a logged angle."""
MAX_SDS = 3.0
"""Largest distance of the mean motion before a test from the median of the other runs.

Unit: standard deviations of such means.
"""
RATE_FLOOR_DEGPS, DEPTH_RATE_FLOOR_MPS = 0.4, 0.05
"""Mean rate (deg/s) and depth rate (m/s) before a test that are always accepted.

They do not disturb the fit.
"""


class PrerollWindow(NamedTuple):
    """Mean motion over STEADY_S before a test: rate (rad/s) and depth rate (m/s, positive down)."""

    rate_radps: float
    depth_rate_mps: float


class UsualPreroll(NamedTuple):
    """Usual motion of one plane before a test."""

    rate_radps: float
    """Median rate of the windows, rad/s: an estimate of the gyro bias."""
    rate_allowed_radps: float
    """Largest accepted distance of a mean rate from ``rate_radps``, rad/s."""
    depth_rate_allowed_mps: float
    """Largest accepted mean depth rate, m/s."""


DEFAULT_PREROLL = UsualPreroll(
    rate_radps=0.0, rate_allowed_radps=math.radians(1.0), depth_rate_allowed_mps=0.15
)
"""Usual motion that is assumed if there are too few other runs."""


def last_window(run: Run) -> PrerollWindow | None:
    """Return the window that ends at the start of the test.

    None if it is shorter than one second.
    """
    before = run.approach
    if np.count_nonzero(before) < RATE_HZ:
        return None
    return _window(run.rate_radps[before], run.time_s[before], run.depth_m[before])


def is_at_stops(run: Run) -> bool:
    """Return whether the tested surface was at its stops in much of the window before the test.

    Parameters
    ----------
    run : Run
        A test.

    Returns
    -------
    bool
        Whether the loop that holds the vehicle between tests is at the limit of its surface.
    """
    before = run.approach
    at_stops = np.abs(run.command_rad[before]) >= run.travel_rad - STOP_TOLERANCE_RAD
    return bool(np.any(before)) and float(np.mean(at_stops)) > MAX_SHARE_AT_STOPS


def usual_prerolls(runs: Sequence[Run]) -> list[UsualPreroll]:
    """Estimate, for each run, the usual motion before a test from the pre-rolls of the other runs.

    With x the window means of the other runs of both planes and median m, the limit is
    ``MAX_SDS * MAD_TO_SD * median(|x - m|)``, and not less than the floor.
    """
    windows = {plane: [_windows(run, plane) for run in runs] for plane in Plane}
    return [
        _usual_preroll(
            [
                window
                for other, group in enumerate(windows[run.plane])
                if other != index
                for window in group
            ]
        )
        for index, run in enumerate(runs)
    ]


def _usual_preroll(windows: Sequence[PrerollWindow]) -> UsualPreroll:
    """Return the usual motion from the windows of the other runs."""
    if len(windows) < MIN_WINDOWS:
        return DEFAULT_PREROLL
    rates, depth_rates = (np.array(values) for values in zip(*windows, strict=True))
    # A window mean differs from the median by the disturbance and by the change of the gyro bias
    # from run to run.
    rate = max(MAX_SDS * _spread(rates), math.radians(RATE_FLOOR_DEGPS))
    depth_rate = max(MAX_SDS * _spread(depth_rates), DEPTH_RATE_FLOOR_MPS)
    return UsualPreroll(float(np.median(rates)), rate, depth_rate)


def roughness_radps(run: Run) -> float:
    """Return the standard deviation of the rate before the test, rad/s."""
    return float(np.std(run.rate_radps[run.approach])) if run.approach.any() else 0.0


def typical_roughness_radps(runs: Sequence[Run]) -> float:
    """Return the median of `roughness_radps` over the runs, rad/s; zero without runs."""
    return float(np.median([roughness_radps(run) for run in runs])) if runs else 0.0


def _windows(run: Run, plane: Plane) -> list[PrerollWindow]:
    """Split the pre-roll of a run into windows and average each; the last one ends at the test."""
    rate = run.in_plane(plane).rate_radps
    end = int(np.count_nonzero(run.preroll))
    slices = [slice(stop - WINDOW, stop) for stop in range(end, WINDOW - 1, -WINDOW)]
    return [_window(rate[part], run.time_s[part], run.depth_m[part]) for part in slices]


def _window(rate_radps: Array, time_s: Array, depth_m: Array) -> PrerollWindow:
    """Return the mean rate, and depth rate as the slope of a straight line."""
    return PrerollWindow(float(np.mean(rate_radps)), fit_line(time_s, depth_m).slope)


def _spread(values: Array) -> float:
    """Return the robust standard deviation: scaled median absolute deviation."""
    return MAD_TO_SD * float(np.median(np.abs(values - np.median(values))))
