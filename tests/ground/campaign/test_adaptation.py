"""Sizes and waits of scaled missions follow the outcome of simulated dives."""

import math
from typing import Any, NamedTuple

import pytest

from ground.campaign import adaptation
from ground.missions import scaling, script
from ground.missions.script import Script
from mavlink_io.mission_items import MavCmd
from sysid.monte_carlo import simulate
from sysid.monte_carlo.readiness import SimulatedTest
from sysid.planes import Plane

LIMITS = {"rudder": 9.0, "elevator": 9.0}


class FakeDive(NamedTuple):
    """Sizes of the tests and first leg of a mission, in place of a simulated dive."""

    sizes_deg: list[float]
    leg_s: float
    calm: bool
    failsafe: str = ""
    thrust_pct: float = 0.0
    """Thrust of the first step."""


class FakeCheck:
    """Vehicle with a limit on the size of tests, a needed wait and a needed size of sweeps."""

    def __init__(
        self,
        largest_deg: float = 90.0,
        wait_s: float = 0.0,
        heard_deg: float = 0.0,
        rough: bool = False,
        failsafe_deg: float = math.inf,
        diving_pct: float = 0.0,
        calm_diving_pct: float = 0.0,
    ):
        self.largest_deg, self.wait_s, self.heard_deg = largest_deg, wait_s, heard_deg
        self.rough, self.failsafe_deg = rough, failsafe_deg
        self.diving_pct, self.calm_diving_pct = diving_pct, calm_diving_pct

    def fly(self, items: Any, disturbance: float = 1.0) -> FakeDive:
        sizes = [item.p2 for item in items if item.command == MavCmd.USER_1]
        leg_s = next(i.p1 for i in items if i.command == MavCmd.NAV_DELAY)
        calm = disturbance == 0.0
        thrust_pct = next(i.p3 for i in items if i.command == MavCmd.DO_CHANGE_SPEED)
        for number, size in enumerate(sizes):
            if abs(size) > self.failsafe_deg:
                return FakeDive(sizes[: number + 1], leg_s, calm, "no effect", thrust_pct)
        return FakeDive(sizes, leg_s, calm, "", thrust_pct)

    def stays_afloat(self, dive: FakeDive) -> bool:
        return dive.thrust_pct < (self.calm_diving_pct if dive.calm else self.diving_pct)

    def outcomes_of_tests(self, dive: FakeDive) -> list[SimulatedTest]:
        return [
            SimulatedTest(
                abs(size) > self.largest_deg,
                dive.leg_s < self.wait_s or (self.rough and not dive.calm),
            )
            for size in dive.sizes_deg
        ]

    def coherence(self, plane: Plane, missions: Any, dives: dict[str, FakeDive]) -> float:
        smallest = min(abs(size) for dive in dives.values() for size in dive.sizes_deg)
        return 0.9 if smallest >= self.heard_deg else 0.3


def adapt(check: FakeCheck, name: str) -> Script:
    adapted = adaptation.adapt(check, {name: script.load(name)}, LIMITS, print)  # type: ignore[arg-type]
    return adapted.scripts[name]


def sizes_deg(mission: Script) -> list[float]:
    tests = [step.test for step in mission.step if step.test is not None]
    return [abs(test.magnitude_deg or 0.0) for test in tests]


def test_adapt_fine_mission_is_unchanged() -> None:
    steps: list[str] = []
    missions = {"combined": script.load("combined")}
    adapted = adaptation.adapt(FakeCheck(), missions, LIMITS, steps.append)  # type: ignore[arg-type]
    assert steps[-1] == "adapting the elevator sweeps in simulation"
    assert adapted.scripts == {"combined": script.load("combined")}
    assert adapted.notes == ()


def test_adapt_large_tests_become_smaller() -> None:
    before = sizes_deg(script.load("rudder_steps"))
    after = sizes_deg(adapt(FakeCheck(6.0), "rudder_steps"))
    assert max(after) <= 6.0
    assert [new for new, old in zip(after, before, strict=True) if old <= 6.0] == [
        old for old in before if old <= 6.0
    ]


def test_adapt_tests_after_a_failsafe_become_smaller_with_it() -> None:
    """One after the other they took more rounds than there are, and the vehicle was refused."""
    check = FakeCheck(failsafe_deg=2.0)
    mission = adapt(check, "elevator_steps")
    assert max(sizes_deg(mission)) <= 2.0
    assert check.fly(script.compile_items(mission)).failsafe == ""


def test_adapt_vehicle_that_stays_afloat_descends_at_full_thrust() -> None:
    """Its tests were made smaller and its legs longer in 100 simulated dives at the surface."""
    unchanged = script.load("rudder_steps")
    assert adapt(FakeCheck(largest_deg=6.0, diving_pct=101.0), "rudder_steps") == (
        scaling.descend_at_full_thrust(unchanged)
    )
    mission = adapt(FakeCheck(largest_deg=6.0, diving_pct=90.0), "rudder_steps")
    assert scaling.descends_at_full_thrust(mission)
    assert max(sizes_deg(mission)) <= 6.0


def test_adapt_vehicle_that_only_waves_help_down_descends_at_full_thrust() -> None:
    """Its tests in calm water ended at the surface: coherence 0.00 with those in the sea."""
    unchanged = script.load("rudder_steps")
    assert adapt(FakeCheck(calm_diving_pct=90.0), "rudder_steps") == (
        scaling.descend_at_full_thrust(unchanged)
    )


def test_adapt_unsettled_vehicle_waits_longer() -> None:
    first = script.load("rudder_steps").step[0].duration_s or 0.0
    assert (
        adapt(FakeCheck(wait_s=1.5 * first), "rudder_steps").step[0].duration_s or 0.0
    ) >= 1.5 * first


def test_adapt_motion_of_the_sea_is_not_waited_for() -> None:
    """A short fat hull was refused: its legs grew eightfold, to the limit of 7200 s armed."""
    assert adapt(FakeCheck(rough=True), "rudder_heldout") == script.load("rudder_heldout")


def test_adapt_endless_motion_ends_with_a_mission_of_an_hour() -> None:
    adapted = adapt(FakeCheck(wait_s=math.inf), "rudder_heldout")
    assert adapted != script.load("rudder_heldout")
    assert simulate.planned_s(script.compile_items(adapted)) <= adaptation.MAX_MISSION_S


@pytest.mark.parametrize("name", ["rudder_sweeps", "elevator_sweeps"])
def test_adapt_masked_sweeps_become_larger(name: str) -> None:
    assert min(sizes_deg(adapt(FakeCheck(heard_deg=7.0), name))) >= 7.0


def test_adapt_masked_sweeps_stay_within_travel() -> None:
    assert max(sizes_deg(adapt(FakeCheck(heard_deg=20.0), "rudder_sweeps"))) == 9.0
