"""Whether the plane that was not tested kept still: its excursions, and how much of its rate
followed the surface."""

import math
from collections.abc import Sequence

import numpy as np
from scipy import signal

from sysid.data.segments import RATE_HZ, STEADY_S, Array, Run
from sysid.screening.limits import ScreeningLimits

FALSE_ALARM = 0.01
SEGMENTS = 7
"""Half-overlapping ones, of a quarter of the run."""
HANN_OVERLAP = 1.0 / 6.0
"""Correlation of two Hann windows that overlap by half (Welch 1967, equation 10)."""
INDEPENDENT = SEGMENTS / (1.0 + 2.0 * HANN_OVERLAP**2 * (SEGMENTS - 1) / SEGMENTS)
EXCITED = 0.1
"""Of the surface's largest power: frequencies at which the test moved it."""


def cross_plane(run: Run, limits: ScreeningLimits, runs: Sequence[Run]) -> str:
    """A test of both surfaces means to move both planes; only rolling spoils it."""
    if run.both:
        return _roll_reason(run, limits)
    return (
        _roll_reason(run, limits)
        or _excursion_reason(run, limits, runs)
        or _coherence_reason(run, limits)
    )


def _roll_reason(run: Run, limits: ScreeningLimits) -> str:
    roll = math.degrees(float(np.max(np.abs(run.roll_rad))))
    return _reason(
        f"roll reached {roll:.0f} deg, at most {limits.roll_deg:g}", roll > limits.roll_deg
    )


def _excursion_reason(run: Run, limits: ScreeningLimits, runs: Sequence[Run]) -> str:
    """The farthest that the other plane went, against what its loop and the sea make of it in such
    a time."""
    if run.plane == "pitch":
        swing, allowed = _degrees(
            run, run.heading_rad, [r.heading_rad for r in runs], runs, limits.cross_heading_deg
        )
        return _reason(f"heading moved {swing:.1f} deg, at most {allowed:.1f}", swing > allowed)
    pitched, allowed = _degrees(
        run, run.pitch_rad, [r.pitch_rad for r in runs], runs, limits.cross_pitch_deg
    )
    sunk, deepest = (
        _excursion(run, run.depth_m),
        max(limits.cross_depth_m, band(runs, [r.depth_m for r in runs], run)),
    )
    return _reason(
        f"pitch moved {pitched:.1f} deg, at most {allowed:.1f}", pitched > allowed
    ) or _reason(f"depth moved {sunk:.2f} m, at most {deepest:.2f}", sunk > deepest)


def _degrees(
    run: Run, values: Array, of_all: Sequence[Array], runs: Sequence[Run], least: float
) -> tuple[float, float]:
    """Excursion of an angle, and what is allowed."""
    return math.degrees(_excursion(run, values)), max(least, math.degrees(band(runs, of_all, run)))


def _reason(what: str, broken: bool) -> str:
    return f"cross-plane coupling: {what}" if broken else ""


def _excursion(run: Run, values: Array) -> float:
    """Largest departure from where the run began."""
    before = values[run.approach]
    return float(np.max(np.abs(values - (np.mean(before) if before.size else values[0]))))


def band(runs: Sequence[Run], values: Sequence[Array], run: Run) -> float:
    """What |x| leaves in the time of ``run`` with a chance of FALSE_ALARM, x being steady and
    Gaussian.

    Rice (1945): x of standard deviation s and rate s' crosses a level c upwards s'/(2 pi s)
    exp(-c^2/(2 s^2)) times a second. Both are means over the pre-rolls, where all loops are closed.
    """
    calm = [
        x[r.preroll]
        for r, x in zip(runs, values, strict=True)
        if np.count_nonzero(r.preroll) > 2 * RATE_HZ
    ]
    if not calm:
        return 0.0
    spread = math.sqrt(float(np.mean([np.var(values) for values in calm])))
    smooth = [
        np.convolve(values, np.full(int(RATE_HZ), 1.0 / RATE_HZ), mode="valid") for values in calm
    ]
    rate = math.sqrt(float(np.mean([np.var(np.diff(values)) for values in smooth]))) * RATE_HZ
    if spread == 0.0:
        return 0.0
    crossings = 2.0 * rate / (2.0 * math.pi * spread) * float(run.time_s[-1] - run.time_s[0])
    return spread * math.sqrt(2.0 * math.log(max(crossings, 1.0) / FALSE_ALARM))


def _coherence_reason(run: Run, limits: ScreeningLimits) -> str:
    rate = run.q_radps if run.plane == "yaw" else run.r_radps
    coherent, bins = coherence(run, rate)
    allowed = max(limits.cross_coherence, significant(bins))
    follows = math.sqrt(coherent) * float(np.std(rate)) / max(float(np.std(run.rate_radps)), 1e-9)
    other = "pitch" if run.plane == "yaw" else "yaw"
    what = f"{other} rate follows the surface, coherence {coherent:.2f}, at most {allowed:.2f}"
    return _reason(what, coherent > allowed and follows > limits.cross_share)


def coherence(run: Run, rate_radps: Array) -> tuple[float, int]:
    """(largest magnitude squared coherence of a rate with the tested surface where that was moved,
    frequencies)."""
    test = run.time_s >= -STEADY_S
    surface, rate = run.command_rad[test], rate_radps[test]
    if np.ptp(surface) == 0.0 or np.ptp(rate) == 0.0:
        return 0.0, 1
    how = {"fs": RATE_HZ, "nperseg": 2 * surface.size // (SEGMENTS + 1), "detrend": "linear"}
    frequency_hz, power = signal.welch(surface, **how)
    _, answer = signal.welch(rate, **how)
    _, both = signal.csd(surface, rate, **how)
    excited = (frequency_hz > 0.0) & (power > EXCITED * np.max(power[1:])) & (answer > 0.0)
    shared = np.abs(both[excited]) ** 2 / (power[excited] * answer[excited])
    return float(np.max(shared, initial=0.0)), int(np.count_nonzero(excited))


def significant(bins: int) -> float:
    """Coherence that unrelated signals pass at one of ``bins`` frequencies with a chance of
    FALSE_ALARM.

    One frequency of n independent segments passes c with (1 - c)^(n - 1) (Carter 1987, equation
    24)."""
    return 1.0 - float((FALSE_ALARM / bins) ** (1.0 / (INDEPENDENT - 1.0)))
