"""Tests of both surfaces at once: sizes, information and mission."""

import tomllib

import pytest

from ground.missions import script
from ground.test_design import files, format
from ground.test_design.files import TestDive
from sysid.planes import PLANES, Plane
from sysid.test_design import candidates, plan
from sysid.test_design.candidates import Lengths
from sysid.test_design.prior import DesignPrior
from sysid.test_design.safety_margins import ExcursionLimits
from sysid.test_design.simulate import Manoeuvre

DIVE = TestDive(6.0, 58.0)
RUDDER = Manoeuvre(Plane.YAW, "multisine", 6.0, 100, 0.05, 0.5, loop_on=True)
ELEVATOR = RUDDER._replace(plane=Plane.PITCH, size_deg=2.0)


def test_scale_to_limits_sizes_stay_within_single_axis_sizes() -> None:
    largest = [(RUDDER, ELEVATOR), (RUDDER._replace(size_deg=5.0), ELEVATOR._replace(size_deg=2.2))]
    share = candidates.elevator_share(largest)
    for rudder, elevator in largest:
        found = candidates.scale_to_limits(RUDDER, rudder, elevator, share)
        assert 0.0 < found.size_deg <= rudder.size_deg
        assert 0.0 < found.elevator_deg <= elevator.size_deg + 1e-9
        assert found.elevator_deg == pytest.approx(share * found.size_deg)
        assert found.surface == "both"


def test_elevator_share_is_at_most_one() -> None:
    """The autopilot's parameter is limited to 100 %."""
    assert candidates.elevator_share([(RUDDER, ELEVATOR._replace(size_deg=9.0))]) == 1.0


@pytest.fixture(scope="module")
def together(bench: DesignPrior) -> plan.TestPlan:
    lengths = Lengths(free_s=(), held_s=(), both_s=(40,), square_s=())
    request = plan.PlanRequest(
        test_time_s=500.0, criterion="crossover", samples=40, lengths=lengths, held_out=False
    )
    return plan.plan(bench, request)


def test_plan_dual_axis_gives_more_information(together: plan.TestPlan) -> None:
    shapes = [one.manoeuvre for one in together.tests]
    (shape,) = {m for m in shapes if m.elevator_deg > 0.0}
    assert shape.mirrored in shapes
    for plane in PLANES:
        assert together.after[plane].crossover_deg < together.paper[plane].crossover_deg


def test_mission_dual_axis_sets_elevator_share(together: plan.TestPlan) -> None:
    text = files.mission(together.tests, DIVE, "tests", "about")
    tests = [step.test for step in script.parse(text, "tests.toml").step if step.test]
    flown = [one.manoeuvre for one in together.tests]
    assert [(t.axis, t.magnitude_deg) for t in tests] == [(m.surface, m.size_deg) for m in flown]
    (shape,) = {m for m in flown if m.elevator_deg > 0.0}
    share = files.envelope(together, ExcursionLimits(), DIVE)["SID_ELE_PCT"]
    assert shape.elevator_deg == pytest.approx(share / 100.0 * shape.size_deg)
    assert text.count("stay within pitch") == sum("pitch" in m.planes for m in flown)
    assert tomllib.loads(text)["step"]
    assert format.format_text(together, []).count("elevator") >= sum(
        "pitch" in m.planes for m in flown
    )
