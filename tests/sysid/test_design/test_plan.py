"""A whole plan: predictions, mission and reproducibility."""

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ground.missions import script
from ground.test_design import files, format
from ground.test_design.files import TestDive
from sitl.vehicle import config
from sysid.design import initial
from sysid.estimation.map import steady_state
from sysid.planes import PLANES, Plane
from sysid.test_design import candidates, plan, prior, safety_margins
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import Manoeuvre
from tests.sysid.test_design.conftest import SHORT

DIVE = TestDive(6.0, 58.0)
UNSTABLE = Path(__file__).parents[3] / "benchmarks/campaigns/vehicles/unstable_yaw.toml"


@pytest.mark.slow
def test_plan_same_seed_gives_same_bytes(bench: DesignPrior, few: plan.TestPlan) -> None:
    again = plan.plan(bench, SHORT)
    assert files.mission(again.tests, DIVE, "a", "b") == files.mission(few.tests, DIVE, "a", "b")
    assert format.as_json(again, {}, {}) == format.as_json(few, {}, {})


def test_plan_uncertainty_is_below_paper_steps(few: plan.TestPlan) -> None:
    for plane in PLANES:
        before, after, paper = few.before[plane], few.after[plane], few.paper[plane]
        assert after.crossover_deg < paper.crossover_deg < before.crossover_deg
        assert after.b1_pct < paper.b1_pct < before.b1_pct


def test_plan_planes_have_opposite_pair_and_held_out_test(
    few: plan.TestPlan,
) -> None:
    for plane in PLANES:
        flown = [one.manoeuvre for one in few.tests if one.manoeuvre.plane == plane]
        assert any(m._replace(size_deg=-m.size_deg) in flown for m in flown)
        (held,) = (one.manoeuvre for one in few.held_out if one.manoeuvre.plane == plane)
        assert held.wave not in {m.wave for m in flown}


def test_plan_stays_within_time_and_limits(few: plan.TestPlan) -> None:
    assert few.test_time_s <= SHORT.test_time_s
    for one in (*few.tests, *few.held_out):
        assert one.excursion.probability <= safety_margins.MAX_PROBABILITY


def test_plan_mission_contains_planned_tests(few: plan.TestPlan) -> None:
    text = files.mission(few.tests, DIVE, "tests", "about")
    flown = script.parse(text, "tests.toml")
    tests = [step.test for step in flown.step if step.test]
    assert [(t.signal, t.axis, t.magnitude_deg, t.duration_s, t.loop_on) for t in tests] == [
        (m.wave, m.surface, m.size_deg, m.duration_s, m.loop_on)
        for m in (one.manoeuvre for one in few.tests)
    ]
    assert script.compile_items(flown)
    held_out = script.parse(files.mission(few.held_out, DIVE, "tests", "about"), "held_out.toml")
    assert script.duration_s(flown) + script.duration_s(held_out) == pytest.approx(few.test_time_s)
    assert tomllib.loads(text)["step"][0]["thrust_pct"] == 58


def test_plan_envelope_equals_limits(few: plan.TestPlan) -> None:
    found = files.envelope(few, SHORT.limits, DIVE)
    assert found["SID_HDG_MAX"] == pytest.approx(60.0)
    assert found["SID_PITCH_MAX"] == pytest.approx(15.0)
    assert found["SID_RATE_MAX"] == pytest.approx(10.0)
    assert found["SID_DEPTH_MIN"] == pytest.approx(3.7)
    assert found["SID_DEPTH_MAX"] == pytest.approx(8.3)
    assert found["SID_TIME_MAX"] > max(one.manoeuvre.duration_s for one in few.tests)


def test_plan_short_time_raises_with_remaining_time(bench: DesignPrior) -> None:
    with pytest.raises(plan.PlanInfeasibleError, match=r"test time 320 s: leaves \d+ s"):
        plan.plan(bench, SHORT._replace(test_time_s=320.0))


def test_tests_of_an_unstable_plane_are_shortened_until_they_fit() -> None:
    """Every length of `Lengths` is too long for a yaw pole of 0.3 1/s, and no step is safe."""
    vehicle = config.load(UNSTABLE)
    known = prior.from_file(vehicle)
    after_tests = known._replace(covariance=0.01 * known.covariance, trims_known=True)
    gains = initial.design_initial_gains(vehicle).parameters
    request = plan.PlanRequest(test_time_s=600.0, samples=60, gains=gains, held_out=False)
    tests = [one.manoeuvre for one in plan.plan(after_tests, request).tests]
    assert {test.plane for test in tests} == set(Plane)
    linear = steady_state.linear_plane(known.vehicle(known.mean), Plane.YAW)
    pole = max(np.linalg.eigvals(linear.A).real)
    in_yaw = [test for test in tests if test.plane == Plane.YAW]
    assert all(test.loop_on for test in in_yaw)
    assert max(pole * test.duration_s for test in in_yaw) < 1.3 * plan.MAX_LOG_GROWTH


def test_long_tests_of_a_plane_that_may_be_unstable_have_the_loop_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No size stays within the limits: with the loop off only 6 s are allowed."""
    plane: Any = SimpleNamespace(
        plane=Plane.YAW, crossover_radps=1.0, nominal_deg=2.0, longest_s=6.0, longest_held_s=70.0
    )
    held, free = (
        Manoeuvre(Plane.YAW, "multisine", 1.0, 60, 0.05, 0.5, loop_on=on) for on in (True, False)
    )
    assert plan._fits(held, plane)
    assert not plan._fits(free, plane)
    assert not plan._fits(held._replace(duration_s=100), plane)
    monkeypatch.setattr(
        plan, "_size_all", lambda plane, shapes, request: [one for one in shapes if one.loop_on]
    )
    tests: list[object] = [*plan._held_out(plane, SHORT)]
    assert tests == [candidates.held_out_test(Plane.YAW, 1.0, 2.0)._replace(loop_on=True)]
