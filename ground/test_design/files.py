"""Files of a test plan: a mission to fit, a mission to hold out, and parameters for both."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from sysid.planes import PLANES, Plane
from sysid.test_design.plan import SETTLING_S, Planned, TestPlan, recovery_s
from sysid.test_design.safety_margins import Excursion, ExcursionLimits
from sysid.test_design.simulate import Manoeuvre

DEPTH_TOLERANCE_M = 0.3
"""Allowed depth error at the start of a test. The abort limits are depths below the surface, the
planned excursions are relative to the start."""


class TestDive(NamedTuple):
    """Depth and thrust of the tests."""

    depth_m: float
    thrust_pct: float


class Files(NamedTuple):
    """Paths of the files of one plan."""

    tests: Path
    held_out: Path
    envelope: Path


def paths_beside(tests: Path) -> Files:
    """Return the paths of all files of a plan, from that of the mission."""
    return Files(tests, tests.with_name(f"{tests.stem}_heldout.toml"), tests.with_suffix(".param"))


def mission(planned: Sequence[Planned], dive: TestDive, name: str, about: str) -> str:
    """Return a mission script: a settling leg, each test with its recovery leg, then surfacing."""
    blocks = [f'name = "{name}"\nabout = "{about}"', _leg(dive, SETTLING_S, first=True)]
    for number, test in enumerate(planned, start=1):
        blocks.append(f"{_comment(number, test)}\n[[step]]\ntest = {_test(test.manoeuvre)}")
        blocks.append(_leg(dive, recovery_s(test.manoeuvre)))
    return "\n\n".join([*blocks, "[[step]]\nsurface = true"]) + "\n"


def _leg(dive: TestDive, seconds: float, *, first: bool = False) -> str:
    """Return a leg of the mission script."""
    thrust = f"thrust_pct = {dive.thrust_pct:g}\n" if first else ""
    return (
        f"[[step]]\ndepth_m = {dive.depth_m:g}\nheading_deg = 0.0\n{thrust}duration_s = {seconds:g}"
    )


def _comment(number: int, planned: Planned) -> str:
    """Return comment lines about the excursion and the information of a test."""
    planes = zip(planned.manoeuvre.planes, planned.excursions, strict=True)
    lines = [f"# {number}. {_describe_excursion(plane, excursion)}" for plane, excursion in planes]
    if planned.share:
        loss = ", ".join(f"{plane} {100.0 * share:.1f} %" for plane, share in planned.share.items())
        lines.append(f"# Without it the sd of the phase at the crossover would rise by: {loss}.")
    return "\n".join(lines)


def _describe_excursion(plane: Plane, excursion: Excursion) -> str:
    """Return the predicted excursion of a test as text."""
    traits = PLANES[plane]
    depth = f", depth {excursion.depth_m:.1f} m" if traits.has_depth else ""
    return (
        f"99 % of the vehicles stay within {traits.angle} {excursion.angle_deg:.0f} deg,"
        f" {excursion.rate_degps:.1f} deg/s{depth};"
        f" probability of leaving the limits {excursion.probability:.3f}."
    )


def _test(manoeuvre: Manoeuvre) -> str:
    """Return a test as an inline table of TOML."""
    return "{ " + ", ".join(f"{key} = {value}" for key, value in _keys(manoeuvre)) + " }"


def _keys(manoeuvre: Manoeuvre) -> Iterator[tuple[str, str]]:
    """Yield the keys of a test with their values as TOML."""
    yield "signal", f'"{manoeuvre.wave}"'
    yield "axis", f'"{manoeuvre.surface}"'
    yield "magnitude_deg", f"{manoeuvre.size_deg:g}"
    yield "duration_s", f"{manoeuvre.duration_s:d}"
    if manoeuvre.wave in ("chirp", "multisine"):
        yield "f_start_hz", f"{manoeuvre.start_hz:g}"
        yield "f_stop_hz", f"{manoeuvre.stop_hz:g}"
    if manoeuvre.wave == "prbs":
        yield "clock_hz", f"{manoeuvre.stop_hz:g}"
        yield "seed", f"{manoeuvre.seed:d}"
    if manoeuvre.wave == "square":
        yield "runs", f"{list(manoeuvre.runs)}"
    if manoeuvre.loop_on:
        yield "loop_on", "true"


def envelope(plan: TestPlan, limits: ExcursionLimits, dive: TestDive) -> dict[str, float]:
    """Return the limits as parameters at which the vehicle aborts a test.

    SID_ELE_PCT, the elevator amplitude in tests of both surfaces, is the same in all tests.
    """
    manoeuvres = [test.manoeuvre for test in (*plan.tests, *plan.held_out)]
    shares = {
        round(100.0 * manoeuvre.elevator_deg / manoeuvre.size_deg)
        for manoeuvre in manoeuvres
        if manoeuvre.elevator_deg
    }
    return {
        "SID_DEPTH_MIN": dive.depth_m - limits.up_m - DEPTH_TOLERANCE_M,
        "SID_DEPTH_MAX": dive.depth_m + limits.down_m + DEPTH_TOLERANCE_M,
        "SID_HDG_MAX": math.degrees(limits.heading_rad),
        "SID_PITCH_MAX": math.degrees(limits.pitch_rad),
        "SID_RATE_MAX": math.degrees(max(limits.yaw_rate_radps, limits.pitch_rate_radps)),
        "SID_TIME_MAX": max(manoeuvre.duration_s for manoeuvre in manoeuvres) + 1.0,
        **({"SID_ELE_PCT": float(max(shares))} if shares else {}),
    }


def parameter_file(values: Mapping[str, float], tests: Path) -> str:
    """Return the text of the parameter file of a plan."""
    lines = [f"# for {tests.name}: abort limits of the tests, trims and gains"]
    return "\n".join([*lines, *(f"{name},{value:.6g}" for name, value in values.items())]) + "\n"
