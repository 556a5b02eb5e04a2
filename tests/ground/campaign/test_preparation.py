"""Missions and first parameters that a simulated vehicle completes.

Missions in which it stays at the surface begin with a descent at full thrust. A cylinder of 1.8 by
0.35 m at 0.84 m/s turned and dived at once in `combined`, and did not leave the surface; at 1.4 m/s
it does.
"""

from typing import Any

import pytest

from ground.campaign import preparation
from ground.campaign.preparation import PreparationRequest
from ground.missions import scaling, script
from mavlink_io.errors import InputError
from mavlink_io.mission_items import MavCmd
from sysid.monte_carlo.readiness import Obstacle

REQUEST = PreparationRequest("slow.toml", "disturbed", "perturbed", 1, ("combined",))
ANY_VEHICLE: Any = None
DESIGNED = {"HDG_REF_RATE": 15.0, "DPT_REF_RATE": 0.2}
MISSIONS = {name: script.load(name) for name in ("straight_run", "combined")}


def obstacle_below(least_pct: float, *, is_afloat: bool = True) -> Any:
    """Return a check whose vehicle dives in `combined` with at least this thrust."""

    def find_obstacle(_: Any, missions: dict[str, Any]) -> Obstacle | None:
        largest_pct = max(i.p3 for i in missions["combined"] if i.command == MavCmd.DO_CHANGE_SPEED)
        if largest_pct >= least_pct:
            return None
        return Obstacle("combined", "it reaches 0.2 of 7.0 m", is_afloat)

    return find_obstacle


def test_only_the_mission_that_needs_it_descends_at_full_thrust(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(preparation, "find_obstacle", obstacle_below(90.0))
    missions, obstacle = preparation._completable(ANY_VEHICLE, MISSIONS)
    assert obstacle is None
    assert missions == {
        "straight_run": MISSIONS["straight_run"],
        "combined": scaling.descend_at_full_thrust(MISSIONS["combined"]),
    }
    (note,) = preparation._describe_descents(missions)
    assert note.endswith("in simulation: combined")


@pytest.mark.parametrize(
    "obstacle", [obstacle_below(101.0), obstacle_below(101.0, is_afloat=False)]
)
def test_other_obstacles_are_refused(obstacle: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preparation, "find_obstacle", obstacle)
    with pytest.raises(InputError, match=r"cannot complete .* combined, .* reaches 0\.2 of 7\.0 m"):
        preparation._first_dives(REQUEST, DESIGNED, lambda _: ANY_VEHICLE, MISSIONS)


@pytest.mark.parametrize(
    ("largest_degps", "largest_deg", "flown"),
    [
        (15.0, 20.0, DESIGNED),
        (9.0, 20.0, DESIGNED | {"HDG_REF_RATE": 9.0}),
        (6.0, 20.0, DESIGNED | {"HDG_REF_RATE": 5.4}),
        (9.0, 15.0, {"HDG_REF_RATE": 9.0, "PTCH_LIM_DEG": 12.0, "DPT_REF_RATE": 0.12}),
        (1.0, 20.0, None),
    ],
)
def test_turns_and_pitch_are_reduced_until_no_failsafe_ends_a_mission(
    largest_degps: float,
    largest_deg: float,
    flown: dict[str, float] | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A hull of 1.5 by 0.25 m spun after a turn at 15 deg/s: "Elevator has no effect"."""

    def find_obstacle(parameters: dict[str, float], _: Any) -> Obstacle | None:
        turns, pitch_deg = parameters["HDG_REF_RATE"], parameters.get("PTCH_LIM_DEG", 20.0)
        if turns <= largest_degps and pitch_deg <= largest_deg:
            return None
        return Obstacle("combined", f"failsafe at {turns:g}", is_failsafe=True)

    monkeypatch.setattr(preparation, "find_obstacle", find_obstacle)

    def first_dives() -> dict[str, float]:
        return preparation._first_dives(REQUEST, DESIGNED, lambda reduced: reduced, MISSIONS)[0]  # type: ignore[arg-type, return-value]

    if flown is None:
        with pytest.raises(InputError, match="failsafe at 15"):
            first_dives()
    else:
        assert first_dives() == pytest.approx(flown)
        assert len(preparation._describe_reductions(DESIGNED, flown)) == (flown != DESIGNED)
