"""Missions in which the simulated vehicle stays at the surface begin with a descent at full thrust.

A cylinder of 1.8 by 0.35 m at 0.84 m/s turned and dived at once in `combined`, and did not leave
the surface; at 1.4 m/s it does.
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
MISSIONS = {name: script.load(name) for name in ("straight_run", "combined")}


def obstacle_below(least_pct: float, *, is_afloat: bool = True) -> Any:
    """Return a check whose vehicle dives in `combined` with at least this thrust."""

    def find_obstacle(_: Any, missions: dict[str, Any]) -> Obstacle | None:
        largest_pct = max(i.p3 for i in missions["combined"] if i.command == MavCmd.DO_CHANGE_SPEED)
        if largest_pct >= least_pct:
            return None
        return Obstacle("combined", "it reaches 0.2 of 7.0 m", is_afloat)

    return find_obstacle


def completable() -> dict[str, script.Script]:
    return preparation._completable(REQUEST, None, MISSIONS)  # type: ignore[arg-type]


def test_only_the_mission_that_needs_it_descends_at_full_thrust(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(preparation, "find_obstacle", obstacle_below(90.0))
    missions = completable()
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
        completable()
