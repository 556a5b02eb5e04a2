"""What is likely the matter when a promise is broken, and what to do about it."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from sysid.monitor import sequential
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.monitor.sequential import Sums

RESONANCE_GROWTH = 1.5
"""A narrow band that grew by so much more than the whole is a loop's, not the sea's."""

_PLANES = {"heading": "rudder", "pitch": "elevator"}
_HELD = ("heading_deg", "depth_m")
"""What an integrator keeps at its set-point on average."""


class Cause(NamedTuple):
    name: str
    """rudder, ballast, elevator, integrator, heading loop, pitch loop, rudder noise, elevator noise
    or sea."""
    words: str
    """What was measured, and what to do."""
    refit_due: bool


def likely_causes(promise: PerformanceBaseline, sums: Sums) -> tuple[Cause, ...]:
    """What moved comes before what it has done to the errors, and before what got louder: a jump is
    loud."""
    moved = sequential.shifted_means(sums)
    averages = tuple(_causes_from_means(promise, moved)) or tuple(_causes_from_integrators(moved))
    return averages or tuple(_causes_from_spreads(sums))


def _causes_from_means(promise: PerformanceBaseline, moved: Mapping[str, float]) -> Iterator[Cause]:
    def off(name: str) -> str:
        mean = promise.predicted[name].mean
        return f"{mean + moved[name]:+.1f} deg on average, {mean:+.1f} identified"

    if "rudder_deg" in moved:
        yield Cause(
            "rudder",
            f"bent duct or drag on one side: rudder {off('rudder_deg')}; fly `trim`, and refit",
            True,
        )
    if "pitch_deg" in moved:
        yield Cause(
            "ballast",
            f"ballast or buoyancy has changed: pitch {off('pitch_deg')}; weigh her in water, and"
            " refit",
            True,
        )
    elif "elevator_deg" in moved:
        yield Cause(
            "elevator",
            f"bent duct, pitch as it was: elevator {off('elevator_deg')}; fly `trim`, and refit",
            True,
        )


def _causes_from_integrators(moved: Mapping[str, float]) -> Iterator[Cause]:
    held = [
        f"{name.split('_')[0]} off by {moved[name]:+.2g} {name.split('_')[1]}"
        for name in _HELD
        if name in moved
    ]
    if held:
        words = f"{' and '.join(held)} on average: an integrator is at its limit; look at the trims"
        yield Cause("integrator", words, refit_due=False)


def _causes_from_spreads(sums: Sums) -> Iterator[Cause]:
    louder, hinted = sequential.increased_rms(sums), sequential.increased_rms(sums, hint=0.0)
    rougher = []
    for plane, surface in _PLANES.items():
        swing, whole = louder.get(f"{plane}_swing_deg", 0.0), hinted.get(f"{plane}_deg", 1.0)
        if swing > RESONANCE_GROWTH * whole:
            words = (
                f"{plane} swings {swing:.1f} times as much as foretold near crossover, {whole:.1f}"
                " times over all"
            )
            yield Cause(
                f"{plane} loop", f"{words}: less damped than designed; refit", refit_due=True
            )
        elif f"{surface}_deg" in louder and f"{plane}_deg" not in hinted:
            words = (
                f"{surface} {louder[f'{surface}_deg']:.1f} times as loud as foretold, {plane} not"
            )
            yield Cause(
                f"{surface} noise",
                f"{words}: other gains aboard, or a louder gyro",
                refit_due=False,
            )
        elif f"{plane}_deg" in louder:
            rougher.append(f"{plane} {whole:.1f} times")
    if rougher:
        words = (
            f"{' and '.join(rougher)} as loud as foretold, near crossover about as much as"
            " elsewhere"
        )
        yield Cause(
            "sea",
            f"rougher than identified: {words}; a little damping lost looks alike",
            refit_due=False,
        )
