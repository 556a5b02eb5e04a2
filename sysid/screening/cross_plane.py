"""Screening rules for the plane that is not tested.

Its excursions, and its coherence with the command.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sysid.data.runs import RATE_HZ, STEADY_S, Array, Run
from sysid.planes import PLANES
from sysid.signal_processing import averaged_spectra

COUPLING = "cross-plane coupling"
"""Beginning of the reasons of `cross_plane`."""
MAX_ROLL_DEG = 20.0
"""Largest roll during a run, deg."""
PITCH_FLOOR_DEG, DEPTH_FLOOR_M = 3.0, 0.5
"""Excursions of pitch (deg) and depth (m) during a rudder test that are always accepted."""
HEADING_FLOOR_DEG = 5.0
"""Heading excursion during an elevator test that is always accepted, deg."""
COHERENCE_FLOOR = 0.3
"""Coherence of the other plane's rate with the tested surface that is always accepted, 0 to 1."""
RATE_SHARE_FLOOR = 0.2
"""Coherent rate of the other plane that is always accepted, over the rate of the tested plane."""
FALSE_ALARM = 0.01
"""Probability that a run without coupling is rejected by one of the statistics here."""
SEGMENTS = 7
"""Number of segments of the spectra.

They overlap by half, and each is a quarter of the run long.
"""
HANN_OVERLAP = 1.0 / 6.0
"""Correlation of two Hann windows that overlap by half (Welch 1967, equation 10)."""
EQUIVALENT_SEGMENTS = SEGMENTS / (1.0 + 2.0 * HANN_OVERLAP**2 * (SEGMENTS - 1) / SEGMENTS)
"""Equivalent number of independent segments: n / (1 + 2 rho^2 (n - 1) / n) (Welch 1967)."""
MIN_RELATIVE_POWER = 0.1
"""Power of the surface, as a share of its largest, from which on a frequency counts as excited."""


class StationaryMotion(NamedTuple):
    """Standard deviation of a signal and of its derivative, where both loops are closed."""

    sd: float
    rate_sd_per_s: float
    """Computed from values that are averaged over one second."""


class PrerollMotions(NamedTuple):
    """Motion before the tests of a campaign."""

    heading_rad: StationaryMotion
    pitch_rad: StationaryMotion
    depth_m: StationaryMotion


def preroll_motions(runs: Sequence[Run]) -> PrerollMotions:
    """Return the motion of the vehicle before its tests: means over all pre-rolls."""
    return PrerollMotions(
        heading_rad=stationary_motion([run.heading_rad[run.preroll] for run in runs]),
        pitch_rad=stationary_motion([run.pitch_rad[run.preroll] for run in runs]),
        depth_m=stationary_motion([run.depth_m[run.preroll] for run in runs]),
    )


def cross_plane(run: Run, before: PrerollMotions) -> str:
    """Reject a run whose other plane moved more than disturbances explain.

    A test of both surfaces moves both planes by intention; it is rejected only for roll.
    """
    if run.both:
        return _roll_reason(run)
    return _roll_reason(run) or _excursion_reason(run, before) or _coherence_reason(run)


def _roll_reason(run: Run) -> str:
    """Reject a run with a large roll angle."""
    roll = math.degrees(float(np.max(np.abs(run.roll_rad))))
    return _reason(f"roll reached {roll:.0f} deg, at most {MAX_ROLL_DEG:g}", roll > MAX_ROLL_DEG)


def _excursion_reason(run: Run, before: PrerollMotions) -> str:
    """Compare the excursion of the other plane with its limit for a run of this length."""
    if not PLANES[run.plane].is_yaw:
        moved_deg = math.degrees(_excursion(run, run.heading_rad))
        allowed_deg = max(HEADING_FLOOR_DEG, math.degrees(band(before.heading_rad, run)))
        return _reason(
            f"heading moved {moved_deg:.1f} deg, at most {allowed_deg:.1f}", moved_deg > allowed_deg
        )
    pitch_deg = math.degrees(_excursion(run, run.pitch_rad))
    allowed_deg = max(PITCH_FLOOR_DEG, math.degrees(band(before.pitch_rad, run)))
    depth_m = _excursion(run, run.depth_m)
    allowed_m = max(DEPTH_FLOOR_M, band(before.depth_m, run))
    return _reason(
        f"pitch moved {pitch_deg:.1f} deg, at most {allowed_deg:.1f}", pitch_deg > allowed_deg
    ) or _reason(f"depth moved {depth_m:.2f} m, at most {allowed_m:.2f}", depth_m > allowed_m)


def _reason(description: str, is_exceeded: bool) -> str:
    """Return the text of a rejection if the limit is exceeded."""
    return f"{COUPLING}: {description}" if is_exceeded else ""


def _excursion(run: Run, values: Array) -> float:
    """Return the largest distance from the mean before the test."""
    before = values[run.approach]
    return float(np.max(np.abs(values - (np.mean(before) if before.size else values[0]))))


def stationary_motion(prerolls: Sequence[Array]) -> StationaryMotion:
    """Return the motion in the pre-rolls of a signal; zero if none is long enough."""
    prerolls = [values for values in prerolls if values.size > 2 * RATE_HZ]
    if not prerolls:
        return StationaryMotion(0.0, 0.0)
    second = np.full(int(RATE_HZ), 1.0 / RATE_HZ)
    averaged = [np.convolve(values, second, mode="valid") for values in prerolls]
    return StationaryMotion(
        sd=math.sqrt(float(np.mean([np.var(values) for values in prerolls]))),
        rate_sd_per_s=math.sqrt(float(np.mean([np.var(np.diff(values)) for values in averaged])))
        * RATE_HZ,
    )


def band(motion: StationaryMotion, run: Run) -> float:
    """Return the level that a Gaussian x exceeds during ``run`` with the probability FALSE_ALARM.

    Rice (1945): x with standard deviation s, whose derivative has the standard deviation s',
    crosses the levels +c and -c upwards and downwards at the mean rate of::

        N(c) = 2 s' / (2 pi s) exp(-c^2 / (2 s^2))    1/s

    N(c) T = FALSE_ALARM over the duration T gives c.
    """
    if motion.sd == 0.0:
        return 0.0
    duration_s = float(run.time_s[-1] - run.time_s[0])
    crossings = 2.0 * motion.rate_sd_per_s / (2.0 * math.pi * motion.sd) * duration_s
    return motion.sd * math.sqrt(2.0 * math.log(max(crossings, 1.0) / FALSE_ALARM))


def _coherence_reason(run: Run) -> str:
    """Compare the coherence of the other plane's rate with the tested surface with its limit."""
    other = PLANES[run.plane].other
    rate = run.in_plane(other).rate_radps
    largest_coherence, bins = coherence(run, rate)
    allowed = max(COHERENCE_FLOOR, significant(bins))
    relative_size = (
        math.sqrt(largest_coherence)
        * float(np.std(rate))
        / max(float(np.std(run.rate_radps)), 1e-9)
    )
    description = (
        f"{other} rate follows the surface, coherence {largest_coherence:.2f},"
        f" at most {allowed:.2f}"
    )
    return _reason(description, largest_coherence > allowed and relative_size > RATE_SHARE_FLOOR)


def coherence(run: Run, rate_radps: Array) -> tuple[float, int]:
    """Return the largest coherence of rate and surface, and the number of excited frequencies.

    The coherence is |S_xy|^2 / (S_xx S_yy), 0 to 1, of spectra by Welch's method (Welch 1967).
    """
    test = run.time_s >= -STEADY_S
    surface, rate = run.command_rad[test], rate_radps[test]
    if np.ptp(surface) == 0.0 or np.ptp(rate) == 0.0:
        return 0.0, 1
    frequency_hz, surface_power, rate_power, cross_power = averaged_spectra(
        surface, rate, RATE_HZ, segment=2 * surface.size // (SEGMENTS + 1)
    )
    excited = (
        (frequency_hz > 0.0)
        & (surface_power > MIN_RELATIVE_POWER * np.max(surface_power[1:]))
        & (rate_power > 0.0)
    )
    coherences = np.abs(cross_power[excited]) ** 2 / (surface_power[excited] * rate_power[excited])
    return float(np.max(coherences, initial=0.0)), int(np.count_nonzero(excited))


def significant(bins: int) -> float:
    """Return the limit that the largest of ``bins`` unrelated coherences exceeds by chance.

    With n independent segments, one frequency exceeds c with the probability (1 - c)^(n - 1)
    (Carter 1987, equation 24); any of them exceeds the limit with the probability FALSE_ALARM.
    """
    return 1.0 - float((FALSE_ALARM / bins) ** (1.0 / (EQUIVALENT_SEGMENTS - 1.0)))
