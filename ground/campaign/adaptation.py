"""Adaptation of scaled missions to a vehicle by simulated dives of its vehicle file.

A test that its envelope ends early, or that the screening would reject, is made smaller. Sweeps
whose response the disturbance masks are made larger. Legs are made longer if the vehicle has not
settled before a test, in the sea and in calm water: the motion of the sea alone does not end. A
vehicle that does not leave the surface begins with a descent at full thrust.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from ground.missions import scaling
from ground.missions.script import Script, compile_items
from ground.missions.signals import TestSignal
from sysid.monte_carlo import simulate
from sysid.monte_carlo.readiness import Readiness
from sysid.monte_carlo.simulate import MissionRejectedError, SimulatedDive
from sysid.planes import PLANES, Plane

MAX_ROUNDS = 8
"""Largest number of simulated dives of a mission, and of changes of its sweeps."""
SMALLER, LARGER, LONGER = 0.8, 1.3, 1.3
"""Factors on the size of tests and on the duration of legs."""
MAX_MISSION_S = 3600.0
"""Largest duration of legs and tests (s) up to which legs are made longer."""
AFTER_FAILSAFE = 0.6
"""Factor on the size of the test before a failsafe."""
COHERENCE = 0.8
"""Coherence about crossover up to which sweeps are made larger; the assessment requires 0.6."""


class AdaptedMissions(NamedTuple):
    """Missions that the simulated vehicle completes as far as the adaptation can reach."""

    scripts: dict[str, Script]
    notes: tuple[str, ...]
    """What was changed, one line per mission or surface."""


def adapt(
    check: Readiness,
    scripts: Mapping[str, Script],
    max_deg: Mapping[str, float],
    announce: Callable[[str], None],
) -> AdaptedMissions:
    """Return missions with adapted sizes and waits.

    Parameters
    ----------
    check : Readiness
        Vehicle, gains and disturbance.
    scripts : Mapping
        Missions by name.
    max_deg : Mapping
        Largest size of a test by surface (deg).
    announce : callable
        Called with each mission and surface before its simulated dives.

    Returns
    -------
    AdaptedMissions
        Missions by name; a mission that cannot be completed remains, and `readiness.find_obstacle`
        gives the reason.
    """
    adapted = dict(scripts)
    for name, script in scripts.items():
        if _tests(script):
            announce(f"adapting {name} in simulation")
            adapted[name] = _fit_envelope(check, _leave_surface(check, script), max_deg)
    notes = [
        f"{name}: tests made smaller, or legs longer, in simulation"
        for name, script in adapted.items()
        if script not in (scripts[name], scaling.descend_at_full_thrust(scripts[name]))
    ]
    for plane in Plane:
        announce(f"adapting the {PLANES[plane].surface} sweeps in simulation")
        larger = _raise_sweeps(check, adapted, max_deg, plane)
        if larger != adapted:
            notes.append(f"{PLANES[plane].surface} sweeps made larger in simulation")
            adapted = larger
    return AdaptedMissions(adapted, tuple(notes))


def _fit_envelope(check: Readiness, script: Script, max_deg: Mapping[str, float]) -> Script:
    """Return a mission whose tests are complete and start from steady flight, if possible."""
    for _ in range(MAX_ROUNDS):
        try:
            dive = check.fly(compile_items(script))
        except MissionRejectedError:
            return script
        if check.stays_afloat(dive):
            return script
        changed = scaling.scale_tests(script, _corrections(check, dive, script), max_deg)
        if _unsettled(check, dive, script):
            changed = scaling.lengthen_legs(changed, LONGER)
        if changed == script:
            return script
        script = changed
    return script


def _leave_surface(check: Readiness, script: Script) -> Script:
    """Return a mission with a descent at full thrust if the vehicle does not dive without.

    Waves can help it down, so it must dive in calm water too: the coherence compares both.
    """
    items = compile_items(script)
    try:
        dives = (check.fly(items, disturbance) for disturbance in (1.0, 0.0))
        is_afloat = any(map(check.stays_afloat, dives))
    except MissionRejectedError:
        return script
    return scaling.descend_at_full_thrust(script) if is_afloat else script


def _corrections(check: Readiness, dive: SimulatedDive, script: Script) -> dict[int, float]:
    """Return the factor on the size by number of the test."""
    outcomes = check.outcomes_of_tests(dive)
    factors = {number: SMALLER for number, outcome in enumerate(outcomes) if outcome.too_large}
    if dive.failsafe and outcomes:
        # also the tests after the failsafe that are not smaller: each would end the dive in turn
        last = len(outcomes) - 1
        signals = [step.test for step in script.step if step.test is not None]
        factors |= {
            number: AFTER_FAILSAFE
            for number, signal in enumerate(signals)
            if number >= last and _is_as_large(signal, signals[last])
        }
    return factors


def _is_as_large(signal: TestSignal, other: TestSignal) -> bool:
    """Return whether a test moves the surface of another by at least the same angle."""
    size_deg, other_deg = signal.magnitude_deg or 0.0, other.magnitude_deg or 0.0
    return signal.axis == other.axis and abs(size_deg) >= abs(other_deg)


def _unsettled(check: Readiness, dive: SimulatedDive, script: Script) -> bool:
    """Return whether a test begins before the motion of a manoeuvre has ended.

    Then its start is unsteady in calm water too. Missions that are long already stay as they are.
    """
    suspects = [test.unsettled for test in check.outcomes_of_tests(dive)]
    items = compile_items(script)
    if not any(suspects) or simulate.planned_s(items) * LONGER > MAX_MISSION_S:
        return False
    calm = check.outcomes_of_tests(check.fly(items, disturbance=0.0))
    return any(a and b.unsettled for a, b in zip(suspects, calm, strict=False))


def _raise_sweeps(
    check: Readiness, scripts: dict[str, Script], max_deg: Mapping[str, float], plane: Plane
) -> dict[str, Script]:
    """Return the missions with larger sweeps of a plane, until their coherence is sufficient."""
    surface = PLANES[plane].surface
    sweeps = {
        name: [number for number, test in enumerate(_tests(script)) if test == (surface, True)]
        for name, script in scripts.items()
    }
    sweeps = {name: numbers for name, numbers in sweeps.items() if numbers}
    for _ in range(MAX_ROUNDS if sweeps else 0):
        items = {name: compile_items(scripts[name]) for name in sweeps}
        try:
            dives = {name: check.fly(mission) for name, mission in items.items()}
        except MissionRejectedError:
            return scripts
        coherence = check.coherence(plane, items, dives)
        if coherence is None or coherence >= COHERENCE:
            return scripts
        larger = {
            name: scaling.scale_tests(scripts[name], dict.fromkeys(numbers, LARGER), max_deg)
            for name, numbers in sweeps.items()
        }
        larger = {name: _fit_envelope(check, larger[name], max_deg) for name in larger}
        larger = {**scripts, **larger}
        if larger == scripts:
            return scripts
        scripts = larger
    return scripts


def _tests(script: Script) -> list[tuple[str, bool]]:
    """Return surface, and whether the signal is a sweep, of each test of a mission."""
    return [
        (step.test.axis, step.test.signal != "step")
        for step in script.step
        if step.test is not None
    ]
