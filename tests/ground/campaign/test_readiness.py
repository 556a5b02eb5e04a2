"""Scenarios in which no campaign can be flown are refused."""

from typing import Any

import pytest

from ground.campaign import readiness
from ground.missions import script
from mavlink_io.errors import InputError

CONTENT: dict[str, Any] = {
    "rig": {"clamped": False},
    "floor": {"depth_m": 20.0, "slope_deg": 0.0, "file": ""},
}
SCRIPTS = {name: script.load(name) for name in ("trim", "elevator_steps")}


def test_scenario_content_shipped_has_every_default() -> None:
    found = readiness.scenario_content("disturbed")
    assert found["disturbance"]["waves"]["yaw_rms_nm"] == 4.96  # sitl/scenarios/disturbed.toml
    assert found["ice"]["draft_m"] == 0.0


def test_scenario_content_missing_file_is_bad_input() -> None:
    with pytest.raises(InputError, match=r"scenario nowhere\.toml: No such file"):
        readiness.scenario_content("nowhere.toml")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rig": {"clamped": True}}, "rig.clamped = true"),
        (
            {"floor": {"depth_m": 9.0, "slope_deg": 0.0, "file": ""}},
            "floor.depth_m = 9: the mission elevator_steps dives to 10 m; expected at least 13",
        ),
    ],
)
def test_refuse_scenario_names_key_and_value(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        readiness.check_scenario("mine.toml", {**CONTENT, **changed}, SCRIPTS)
    readiness.check_scenario("mine.toml", CONTENT, SCRIPTS)
