"""Likely causes of a deviation from the predicted performance, and the recommended action."""

import math
from collections.abc import Iterator, Mapping, Sequence

from sysid.models.json_record import JsonRecord
from sysid.monitor import sequential
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.monitor.sequential import Sums
from sysid.monitor.windows import MonitorWindow
from sysid.planes import PLANES

RESONANCE_GROWTH = 1.5
"""Ratio of band to total growth above which the loop, not the disturbance, is the cause."""
MIN_RESONANCE_SHARE, MIN_RESONANCE_DEG = 0.15, 0.03
"""Excess near crossover that is a loss of damping: share of the angle's variance, and rms (deg).

Where the disturbance hardly excites the resonance, sensor noise and backlash, which the prediction
contains in part only, multiply the small rms there: by 5 in a campaign of a vehicle of 3 kg, which
had the designed damping. Such an excess was up to 0.18 of the variance of a few windows, and
0.018 deg."""

_HELD = ("heading_deg", "depth_m")
"""Quantities whose mean an integrator keeps at the set-point."""


class Cause(JsonRecord, frozen=True):
    """One likely cause."""

    name: str
    """Name of the cause.

    One of: rudder, ballast, elevator, integrator, heading loop, pitch loop, rudder noise, elevator
    noise, sea.
    """
    message: str
    """Measured deviation and recommended action."""
    refit_recommended: bool
    """Whether the cause requires new tests and a refit."""


def likely_causes(
    baseline: PerformanceBaseline, sums: Sums, windows: Sequence[MonitorWindow]
) -> tuple[Cause, ...]:
    """Return the likely causes of an alarm.

    Parameters
    ----------
    baseline : PerformanceBaseline
        Predicted statistics.
    sums : Sums
        State of the sequential tests.
    windows : sequence of MonitorWindow
        Windows of steady flight until now, in order of time.

    Returns
    -------
    tuple of Cause
        Shifted means take precedence over saturated integrators, and these over increased
        variances, because a step in a mean also increases the variance.
    """
    shifts = sequential.shifted_means(sums)
    mean_causes = tuple(_causes_from_means(baseline, shifts)) or tuple(
        _causes_from_integrators(shifts)
    )
    return mean_causes or tuple(_causes_from_spreads(baseline, sums, windows))


def _causes_from_means(
    baseline: PerformanceBaseline, shifts: Mapping[str, float]
) -> Iterator[Cause]:
    """Yield causes of shifted means."""

    def describe(name: str) -> str:
        """Return measured and identified mean as text."""
        mean = baseline.predicted[name].mean
        return f"{mean + shifts[name]:+.1f} deg on average, {mean:+.1f} identified"

    if "rudder_deg" in shifts:
        yield Cause(
            "rudder",
            f"bent duct or drag on one side: rudder {describe('rudder_deg')}; fly `trim`,"
            " and refit",
            True,
        )
    if "pitch_deg" in shifts:
        yield Cause(
            "ballast",
            f"ballast or buoyancy has changed: pitch {describe('pitch_deg')}; weigh the vehicle"
            " in water, and refit",
            True,
        )
    elif "elevator_deg" in shifts:
        yield Cause(
            "elevator",
            f"bent duct, pitch unchanged: elevator {describe('elevator_deg')}; fly `trim`, and"
            " refit",
            True,
        )


def _causes_from_integrators(shifts: Mapping[str, float]) -> Iterator[Cause]:
    """Yield the cause of a mean error that an integrator should compensate."""
    deviations = [
        f"{name.split('_')[0]} off by {shifts[name]:+.2g} {name.split('_')[1]}"
        for name in _HELD
        if name in shifts
    ]
    if deviations:
        message = (
            f"{' and '.join(deviations)} on average: an integrator is at its limit; check the trims"
        )
        yield Cause("integrator", message, refit_recommended=False)


def _total_ratio(
    baseline: PerformanceBaseline, sums: Sums, windows: Sequence[MonitorWindow], angle: str
) -> float:
    """Return the rms of an angle over the predicted one, in the windows of its resonance test.

    The rms is that about the mean of each window. At least one: a smaller error is that of a
    calmer sea.
    """
    since = windows[len(windows) - sums[f"{angle}_resonance_deg", "variance"].windows :]
    name = f"{angle}_deg"
    variance = sum(window.variances[name] for window in since) / max(1, len(since))
    return math.sqrt(max(1.0, variance / sequential.window_variance(baseline.predicted[name])))


def _is_less_damped(
    baseline: PerformanceBaseline, angle: str, resonance: float, total: float
) -> bool:
    """Return whether the rms near crossover has grown alone, and by an amount that matters."""
    in_band, whole = (
        sequential.window_variance(baseline.predicted[name])
        for name in (f"{angle}_resonance_deg", f"{angle}_deg")
    )
    excess = (resonance**2 - 1.0) * in_band
    least = max(MIN_RESONANCE_SHARE * total**2 * whole, MIN_RESONANCE_DEG**2)
    return resonance > RESONANCE_GROWTH * total and excess > least


def _causes_from_spreads(
    baseline: PerformanceBaseline, sums: Sums, windows: Sequence[MonitorWindow]
) -> Iterator[Cause]:
    """Yield causes of increased variances."""
    increased, all_ratios = sequential.increased_rms(sums), sequential.increased_rms(sums, hint=0.0)
    disturbed = []
    for angle, surface in ((traits.angle, traits.surface) for traits in PLANES.values()):
        resonance = increased.get(f"{angle}_resonance_deg", 0.0)
        total = _total_ratio(baseline, sums, windows, angle)
        if _is_less_damped(baseline, angle, resonance, total):
            message = (
                f"{angle} rms near crossover {resonance:.1f} times the predicted one, {total:.1f}"
                " times in total"
            )
            yield Cause(
                f"{angle} loop",
                f"{message}: less damping than designed; refit",
                refit_recommended=True,
            )
        elif f"{surface}_deg" in increased and f"{angle}_deg" not in all_ratios:
            message = (
                f"{surface} rms {increased[f'{surface}_deg']:.1f} times the predicted one, {angle}"
                " rms not"
            )
            yield Cause(
                f"{surface} noise",
                f"{message}: motor steps or noise of the gyro or the pressure sensor that the tests"
                " did not show, or other gains are set",
                refit_recommended=False,
            )
        elif f"{angle}_deg" in increased:
            disturbed.append(f"{angle} {increased[f'{angle}_deg']:.1f} times")
    if disturbed:
        message = (
            f"{' and '.join(disturbed)} the predicted rms, near crossover about as much as"
            " elsewhere"
        )
        yield Cause(
            "sea",
            f"disturbance larger than identified: {message}; slightly reduced damping, and backlash"
            " of the tailcone, which is not predicted, have the same effect",
            refit_recommended=False,
        )
