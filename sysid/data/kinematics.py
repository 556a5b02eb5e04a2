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
from typing import NamedTuple

import numpy as np

from sysid.data.runs import RATE_HZ, Array, Run
from sysid.signal_processing import fit_line

MAX_PITCH_RAD = math.radians(75.0)
"""Pitch above which heading is not evaluated, because of the singularity at 90 degrees."""
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
    weight_rad2: float
    """Sum of squares of the integrated rate about a straight line; ratios of runs have this weight
    in their mean."""


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
    if np.max(np.abs(run.pitch_rad)) > MAX_PITCH_RAD:
        return None
    yaw_rate = run.q_radps * np.sin(run.roll_rad) + run.r_radps * np.cos(run.roll_rad)
    return _mismatch(run.time_s, run.heading_rad, yaw_rate / np.cos(run.pitch_rad))


def pitch_mismatch(run: Run) -> AngleRateMismatch:
    """Compare pitch with the integrated rates."""
    pitch_rate = run.q_radps * np.cos(run.roll_rad) - run.r_radps * np.sin(run.roll_rad)
    return _mismatch(run.time_s, run.pitch_rad, pitch_rate)


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
        weight_rad2=power,
    )


def _without_line(time_s: Array, values: Array) -> Array:
    """Return values less the straight line in time that fits them best."""
    return values - fit_line(time_s, values).values


def _integral(rate: Array) -> Array:
    """Return the integral of a rate on the run's grid by the trapezoidal rule, from zero."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1])))) / RATE_HZ


def _rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
