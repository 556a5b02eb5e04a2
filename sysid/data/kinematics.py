"""Kinematic consistency of a run's angles, rates and depth: a check of the data without a model.

Symbols (FRD, NED): phi roll, theta pitch, psi heading (rad), p, q, r rates (rad/s), U forward speed
and w heave (m/s).

    psi' = (q sin(phi) + r cos(phi)) / cos(theta),  theta' = q cos(phi) - r sin(phi)
                                                    (Fossen 2021, equation 2.41)
    depth' = w - U sin(theta), with w small and U nearly constant  (docs/physics.md)

A wrong sign, degrees instead of radians, streams with a time offset and frozen sensors violate at
least one of the three.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from sysid.data.runs import RATE_HZ, Array, Run
from sysid.signal_processing import fit_line

MAX_PITCH_RAD = math.radians(75.0)
"""Pitch above which heading is not evaluated, because of the singularity at 90 degrees."""
MIN_FITTED_RUNS = 3
"""Least number of runs from which ratio and lag of an angle and its rate are estimated."""
MIN_DEPTH_SENSITIVITY_S = 0.5
"""Minimum range of the integral of -sin(theta) for a comparison of depth and pitch.

It is the depth change (m) at 1 m/s."""


class AngleRateMismatch(NamedTuple):
    """Difference of an angle and its integrated rate."""

    rms_rad: float
    """Root mean square about a straight line, which is a constant error of the rate."""
    bias_radps: float
    """Slope of that line: constant error of the rate."""
    excursion_rad: float
    """Range of the angle."""
    ratio: float
    """Change of the angle over that of the integrated rate; 1 if both are right."""


class AngleRateFit(NamedTuple):
    """How an angle follows its integrated rate in several runs.

    The standard deviations are those of the jackknife over the runs.
    """

    ratio: float
    """Change of the angle over that of the integrated rate."""
    ratio_sd: float
    lag_s: float
    """Time by which the angle is late; negative if the rate is, NaN for a frozen angle."""
    lag_sd_s: float


class DepthPitchMismatch(NamedTuple):
    """Difference of depth and the depth computed from speed and pitch."""

    rms_m: float
    """Root mean square about a straight line."""
    speed_mps: float
    """Speed with the best agreement; negative if depth changes in the wrong direction."""
    excursion_m: float
    """Range of depth."""
    depth_rms_m: float
    """Root mean square of depth about a straight line."""
    sine_rms_s: float
    """Root mean square, about a straight line, of the depth change by pitch at 1 m/s."""
    sine_range_s: float
    """Range of the same."""


def heading_mismatch(run: Run) -> AngleRateMismatch | None:
    """Compare heading with the integrated rates; None if the pitch exceeds MAX_PITCH_RAD."""
    if not _has_heading_rate(run):
        return None
    return _mismatch(run.time_s, run.heading_rad, _heading_rate(run))


def pitch_mismatch(run: Run) -> AngleRateMismatch:
    """Compare pitch with the integrated rates."""
    return _mismatch(run.time_s, run.pitch_rad, _pitch_rate(run))


def fit_heading(runs: Iterable[Run]) -> AngleRateFit | None:
    """Compare the headings of several runs with the integrated rates; None if too few turn."""
    return _fit(
        _normal_equations(run.time_s, run.heading_rad, _heading_rate(run))
        for run in runs
        if _has_heading_rate(run)
    )


def fit_pitch(runs: Iterable[Run]) -> AngleRateFit | None:
    """Compare the pitch of several runs with the integrated rates; None if too few turn."""
    return _fit(_normal_equations(run.time_s, run.pitch_rad, _pitch_rate(run)) for run in runs)


def _has_heading_rate(run: Run) -> bool:
    """Return whether the heading is far enough from the singularity throughout a run."""
    return bool(np.max(np.abs(run.pitch_rad)) <= MAX_PITCH_RAD)


def _heading_rate(run: Run) -> Array:
    """Return the rate of the heading by the measured rates (rad/s)."""
    yaw_rate = run.q_radps * np.sin(run.roll_rad) + run.r_radps * np.cos(run.roll_rad)
    return np.asarray(yaw_rate / np.cos(run.pitch_rad))


def _pitch_rate(run: Run) -> Array:
    """Return the rate of the pitch by the measured rates (rad/s)."""
    return np.asarray(run.q_radps * np.cos(run.roll_rad) - run.r_radps * np.sin(run.roll_rad))


def depth_mismatch(run: Run) -> DepthPitchMismatch | None:
    """Compare depth with pitch; None if the pitch changed the depth too little.

    A straight line in time is free; it represents heave w and an offset of pitch.
    """
    # Least squares: depth = c_0 + c_1 t + U integral of -sin(theta).
    sine_integral_s = -_integral(np.sin(run.pitch_rad))
    # The line is eliminated from both first: regression of the remainders gives the same U.
    sine_rest_s = _without_line(run.time_s, sine_integral_s)
    depth_rest_m = _without_line(run.time_s, run.depth_m)
    if np.ptp(sine_rest_s) < MIN_DEPTH_SENSITIVITY_S:
        return None
    speed_mps = float(sine_rest_s @ depth_rest_m) / float(sine_rest_s @ sine_rest_s)
    return DepthPitchMismatch(
        rms_m=_rms(depth_rest_m - speed_mps * sine_rest_s),
        speed_mps=speed_mps,
        excursion_m=float(np.ptp(run.depth_m)),
        depth_rms_m=_rms(depth_rest_m),
        sine_rms_s=_rms(sine_rest_s),
        sine_range_s=float(np.ptp(sine_rest_s)),
    )


def _mismatch(time_s: Array, angle_rad: Array, rate_radps: Array) -> AngleRateMismatch:
    """Return the difference of an angle and the integral of a rate."""
    integral_rad = _integral(rate_radps)
    difference = angle_rad - integral_rad
    line = fit_line(time_s, difference)
    # Least squares: angle = c_0 + c_1 t + ratio times the integral, as in ``depth_mismatch``.
    integral_rest = _without_line(time_s, integral_rad)
    power = float(integral_rest @ integral_rest)
    return AngleRateMismatch(
        rms_rad=_rms(difference - line.values),
        bias_radps=line.slope,
        excursion_rad=float(np.ptp(angle_rad)),
        ratio=float(integral_rest @ angle_rad) / power if power > 0.0 else math.nan,
    )


def _normal_equations(time_s: Array, angle_rad: Array, rate_radps: Array) -> Array:
    """Return X'X and X'y side by side (2, 3), for the ratio and its product with the lag of a run.

    With k the ratio and T the lag, angle = c_0 + c_1 t + k (integral of the rate - T rate).
    """
    regressors = np.column_stack(
        [_without_line(time_s, column) for column in (_integral(rate_radps), -rate_radps)]
    )
    target = _without_line(time_s, angle_rad)
    return np.column_stack([regressors.T @ regressors, regressors.T @ target])


def _fit(normal_equations: Iterable[Array]) -> AngleRateFit | None:
    """Solve the sum of the equations of several runs; None if it has no unique solution."""
    parts = np.array(list(normal_equations))
    if len(parts) < MIN_FITTED_RUNS:
        return None
    whole = parts.sum(axis=0)
    sums = np.array([whole, *(whole - parts)])
    if not np.all(np.linalg.matrix_rank(sums[:, :, :2]) == 2):
        return None
    ratio, product = np.linalg.solve(sums[:, :, :2], sums[:, :, 2:])[:, :, 0].T
    lag_s = np.divide(product, ratio, out=np.full_like(ratio, np.nan), where=ratio != 0.0)
    ratio_sd, lag_sd_s = np.sqrt((len(parts) - 1) * np.var([ratio[1:], lag_s[1:]], axis=1))
    return AngleRateFit(float(ratio[0]), float(ratio_sd), float(lag_s[0]), float(lag_sd_s))


def _without_line(time_s: Array, values: Array) -> Array:
    """Return values less the straight line in time that fits them best."""
    return values - fit_line(time_s, values).values


def _integral(rate: Array) -> Array:
    """Return the integral of a rate on the run's grid by the trapezoidal rule, from zero."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1])))) / RATE_HZ


def _rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
