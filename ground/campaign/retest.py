"""Dive with the test that the assessment of a model recommends.

The assessment names plane, signal and size. Duration, frequencies and the largest size are those of
the campaign's own tests with this signal, which were scaled and adapted to the vehicle. The test is
repeated with alternating sign.
"""

from collections.abc import Iterable, Mapping
from itertools import takewhile
from typing import NamedTuple

from msgspec.structs import replace

from ground.missions import scaling
from ground.missions.script import MissionStep, Script, compile_items
from ground.missions.signals import TestSignal
from sysid.monte_carlo import simulate
from sysid.planes import PLANES
from sysid.validation.acceptance import WAVE_TO_HOLD_OUT
from sysid.validation.results import NextTest

REPETITIONS = 4
"""Number of tests in a dive."""
MISSIONS_WITH_SIGNAL = {"chirp": "sweeps", "step": "steps", WAVE_TO_HOLD_OUT: "heldout"}
"""End of the name of the mission that has a signal; it begins with the surface."""


class Retest(NamedTuple):
    """Dive with a recommended test."""

    mission: str
    script: Script
    base: str
    """Mission of the campaign whose tests it repeats."""
    held_out: bool
    """Whether its tests are predicted and not fitted."""
    planned_s: float
    """Duration of legs and tests."""


def plan(missions: Mapping[str, Script], recommended: NextTest, mission: str) -> Retest | None:
    """Return the dive with a recommended test.

    Parameters
    ----------
    missions : Mapping
        Test missions of the campaign by name.
    recommended : NextTest
        Test that the assessment names.
    mission : str
        Name of the new mission.

    Returns
    -------
    Retest or None
        None if no mission has a test with this signal.
    """
    surface = PLANES[recommended.plane].surface
    base = f"{surface}_{MISSIONS_WITH_SIGNAL[recommended.signal]}"
    tests = [
        step.test
        for step in missions[base].step
        if step.test is not None and (step.test.signal, step.test.axis) == _kind(recommended)
    ]
    approach = list(takewhile(lambda step: step.test is None, missions[base].step))
    legs = [step for step in missions[base].step[len(approach) :] if step.leg_keys]
    if not tests or not legs:
        return None
    steps = approach
    for number in range(REPETITIONS):
        steps += [_test_step(recommended, tests, number), legs[0]]
    about = f"{recommended}: {recommended.reason}"
    script = Script(name=mission, about=about, step=(*steps, MissionStep(surface=True)))
    return Retest(
        mission=mission,
        script=script,
        base=base,
        held_out=recommended.signal == WAVE_TO_HOLD_OUT,
        planned_s=simulate.planned_s(compile_items(script)),
    )


def _kind(recommended: NextTest) -> tuple[str, str]:
    """Return signal and axis of a recommended test."""
    return recommended.signal, PLANES[recommended.plane].surface


def _test_step(recommended: NextTest, tests: Iterable[TestSignal], number: int) -> MissionStep:
    """Return one repetition, with the sign alternating."""
    largest = max(tests, key=lambda test: abs(test.magnitude_deg or 0.0))
    limit_deg = abs(largest.magnitude_deg or 0.0)
    size_deg = scaling.limited_deg(recommended.magnitude_deg, limit_deg)
    signed_deg = -size_deg if number % 2 else size_deg
    return MissionStep(test=replace(largest, magnitude_deg=signed_deg))
