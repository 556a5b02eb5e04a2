"""A plan as files: the mission that is fitted, the one that is held out, and the parameters that go
with both."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from sysid.test_design.plan import SETTLING_S, Planned, PlanRequest, TestPlan, recovery_s
from sysid.test_design.safety_margins import Excursion, ExcursionLimits
from sysid.test_design.simulate import Manoeuvre

DEPTH_TOLERANCE_M = 0.3
"""What the depth loop may be off when a test begins: the envelope counts from the surface,
excursions do not."""


class TestDive(NamedTuple):
    """Where and how fast the tests are flown."""

    depth_m: float
    thrust_pct: float


class Files(NamedTuple):
    """Paths that belong together, by the mission's."""

    tests: Path
    held_out: Path
    envelope: Path


def paths_beside(tests: Path) -> Files:
    return Files(tests, tests.with_name(f"{tests.stem}_heldout.toml"), tests.with_suffix(".param"))


def mission(
    planned: Sequence[Planned], dive: TestDive, request: PlanRequest, name: str, about: str
) -> str:
    """A mission script: a settling leg, then each test and its recovery, then the surface."""

    blocks = [f'name = "{name}"\nabout = "{about}"', _leg(dive, SETTLING_S, first=True)]
    for number, one in enumerate(planned, start=1):
        blocks.append(f"{_comment(number, one)}\n[[step]]\ntest = {_test(one.manoeuvre)}")
        blocks.append(_leg(dive, recovery_s(one.manoeuvre, request)))
    return "\n\n".join([*blocks, "[[step]]\nsurface = true"]) + "\n"


def _leg(dive: TestDive, seconds: float, *, first: bool = False) -> str:
    thrust = f"thrust_pct = {dive.thrust_pct:g}\n" if first else ""
    return (
        f"[[step]]\ndepth_m = {dive.depth_m:g}\nheading_deg = 0.0\n{thrust}duration_s = {seconds:g}"
    )


def _comment(number: int, planned: Planned) -> str:
    """What a test is for and how far it goes, as comments."""
    planes = zip(planned.manoeuvre.planes, planned.excursions, strict=True)
    lines = [f"# {number}. {_describe_excursion(plane, excursion)}" for plane, excursion in planes]
    if planned.share:
        told = ", ".join(f"{plane} {100.0 * share:.1f} %" for plane, share in planned.share.items())
        lines.append(f"# Without it the phase at the crossover would be less sure by: {told}.")
    return "\n".join(lines)


def _describe_excursion(plane: str, found: Excursion) -> str:
    angle, depth = (
        ("heading", "") if plane == "yaw" else ("pitch", f", depth {found.depth_m:.1f} m")
    )
    return (
        f"99 of 100 stay within {angle} {found.angle_deg:.0f} deg, {found.rate_degps:.1f}"
        f" deg/s{depth}; probability of leaving the limits {found.probability:.3f}."
    )


def _test(what: Manoeuvre) -> str:
    return "{ " + ", ".join(f"{key} = {value}" for key, value in _keys(what)) + " }"


def _keys(what: Manoeuvre) -> Iterator[tuple[str, str]]:
    yield "signal", f'"{what.wave}"'
    yield "axis", f'"{what.surface}"'
    yield "magnitude_deg", f"{what.size_deg:g}"
    yield "duration_s", f"{what.duration_s:d}"
    if what.wave in ("chirp", "multisine"):
        yield "f_start_hz", f"{what.start_hz:g}"
        yield "f_stop_hz", f"{what.stop_hz:g}"
    if what.wave == "prbs":
        yield "clock_hz", f"{what.stop_hz:g}"
        yield "seed", f"{what.seed:d}"
    if what.wave == "square":
        yield "runs", f"{list(what.runs)}"
    if what.loop_on:
        yield "loop_on", "true"


def envelope(plan: TestPlan, limits: ExcursionLimits, dive: TestDive) -> dict[str, float]:
    """The limits as the parameters by which the vehicle ends a test that leaves them; and the
    elevator's share of tests of both surfaces, which is the same in all."""
    flown = [one.manoeuvre for one in (*plan.tests, *plan.held_out)]
    shares = {
        round(100.0 * what.elevator_deg / what.size_deg) for what in flown if what.elevator_deg
    }
    return {
        "SID_DEPTH_MIN": dive.depth_m - limits.up_m - DEPTH_TOLERANCE_M,
        "SID_DEPTH_MAX": dive.depth_m + limits.down_m + DEPTH_TOLERANCE_M,
        "SID_HDG_MAX": math.degrees(limits.heading_rad),
        "SID_PITCH_MAX": math.degrees(limits.pitch_rad),
        "SID_RATE_MAX": math.degrees(max(limits.yaw_rate_radps, limits.pitch_rate_radps)),
        "SID_TIME_MAX": max(what.duration_s for what in flown) + 1.0,
        **({"SID_ELE_PCT": float(max(shares))} if shares else {}),
    }


def parameter_file(values: Mapping[str, float], tests: Path) -> str:
    lines = [f"# goes with {tests.name}: what ends a test, and what the tests are counted from"]
    return "\n".join([*lines, *(f"{name},{value:.6g}" for name, value in values.items())]) + "\n"
