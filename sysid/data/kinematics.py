"""Whether a run's angles, rates and depth can be those of one body: a check of the data, before any
model.

Turning: psi' = (q sin(phi) + r cos(phi)) / cos(theta), theta' = q cos(phi) - r sin(phi) (Fossen
2021, equation 2.41). Sinking: depth' = w - U sin(theta), with w small and U nearly constant
(docs/physics.md). A swapped sign, degrees taken for radians, streams out of step and sensors that
stand still all break one of the three; no model is asked."""

import math
from typing import NamedTuple

import numpy as np

from sysid.data.segments import RATE_HZ, Array, Run

MAX_PITCH_RAD = math.radians(75.0)
"""Heading is no measure of anything beyond this pitch."""
MIN_DEPTH_SENSITIVITY_S = 0.5
"""Depth tells of pitch where that would have moved the vehicle by so much at 1 m/s."""


class AngleRateMismatch(NamedTuple):
    """What remains between an angle and its integrated rate."""

    rms_rad: float
    """Around the straight line that a constant error of the rate draws."""
    bias_radps: float
    excursion_rad: float
    """Between the angle's extremes."""


class DepthPitchMismatch(NamedTuple):
    """What remains between depth and what speed and pitch make of it."""

    rms_m: float
    speed_mps: float
    """At which depth follows pitch best; negative where it moves the wrong way."""
    excursion_m: float


def heading_mismatch(run: Run) -> AngleRateMismatch | None:
    """Heading against the rates; None where the vehicle stood too steeply to have one."""
    if np.max(np.abs(run.pitch_rad)) > MAX_PITCH_RAD:
        return None
    turning = run.q_radps * np.sin(run.roll_rad) + run.r_radps * np.cos(run.roll_rad)
    return _mismatch(run.time_s, run.heading_rad, turning / np.cos(run.pitch_rad))


def pitch_mismatch(run: Run) -> AngleRateMismatch:
    """Pitch against the rates."""
    pitching = run.q_radps * np.cos(run.roll_rad) - run.r_radps * np.sin(run.roll_rad)
    return _mismatch(run.time_s, run.pitch_rad, pitching)


def depth_mismatch(run: Run) -> DepthPitchMismatch | None:
    """Depth against pitch; None where pitch hardly moved the vehicle.

    A straight line in time is left to w and to an offset of pitch.
    """
    way = -_integral(np.sin(run.pitch_rad))
    drift = np.stack([np.ones(run.time_s.size), run.time_s], axis=1)
    if np.ptp(way - drift @ np.linalg.lstsq(drift, way, rcond=None)[0]) < MIN_DEPTH_SENSITIVITY_S:
        return None
    base = np.column_stack([drift, way])
    found = np.linalg.lstsq(base, run.depth_m, rcond=None)[0]
    return DepthPitchMismatch(
        _rms(run.depth_m - base @ found), float(found[2]), float(np.ptp(run.depth_m))
    )


def _mismatch(time_s: Array, angle_rad: Array, rate_radps: Array) -> AngleRateMismatch:
    between = angle_rad - _integral(rate_radps)
    line = np.polynomial.Polynomial.fit(time_s, between, 1)
    bias = float(line.convert().coef[-1]) if time_s.size > 1 else 0.0
    return AngleRateMismatch(_rms(between - line(time_s)), bias, float(np.ptp(angle_rad)))


def _integral(rate: Array) -> Array:
    """By trapezoids on the runs' grid, from zero."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1])))) / RATE_HZ


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
