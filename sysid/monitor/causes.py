"""Likely causes of a deviation from the predicted performance, and the recommended action."""

from collections.abc import Iterator, Mapping

from sysid.models.json_record import JsonRecord
from sysid.monitor import sequential
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.monitor.sequential import Sums
from sysid.planes import PLANES

RESONANCE_GROWTH = 1.5
"""Ratio of band to total growth above which the loop, not the disturbance, is the cause."""

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


def likely_causes(baseline: PerformanceBaseline, sums: Sums) -> tuple[Cause, ...]:
    """Return the likely causes of an alarm.

    Parameters
    ----------
    baseline : PerformanceBaseline
        Predicted statistics.
    sums : Sums
        State of the sequential tests.

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
    return mean_causes or tuple(_causes_from_spreads(sums))


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


def _causes_from_spreads(sums: Sums) -> Iterator[Cause]:
    """Yield causes of increased variances."""
    increased, all_ratios = sequential.increased_rms(sums), sequential.increased_rms(sums, hint=0.0)
    disturbed = []
    for angle, surface in ((traits.angle, traits.surface) for traits in PLANES.values()):
        resonance, total = (
            increased.get(f"{angle}_resonance_deg", 0.0),
            all_ratios.get(f"{angle}_deg", 1.0),
        )
        if resonance > RESONANCE_GROWTH * total:
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
                f"{message}: other gains are set, or the gyro noise has increased",
                refit_recommended=False,
            )
        elif f"{angle}_deg" in increased:
            disturbed.append(f"{angle} {total:.1f} times")
    if disturbed:
        message = (
            f"{' and '.join(disturbed)} the predicted rms, near crossover about as much as"
            " elsewhere"
        )
        yield Cause(
            "sea",
            f"disturbance larger than identified: {message}; slightly reduced damping has the same"
            " effect",
            refit_recommended=False,
        )
