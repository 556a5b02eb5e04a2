"""Scenarios in which no campaign can be flown are refused."""

from typing import Any

import pytest
from msgspec.structs import replace

from ground.campaign import readiness
from ground.missions import script
from mavlink_io.errors import InputError
from sysid import prior_knowledge

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


@pytest.mark.parametrize("net_buoyancy_n", [5.0, 80.0])
def test_vehicle_heavier_than_surface_water_refused(net_buoyancy_n: float) -> None:
    """In water of 1008 kg/m3 a vehicle of 640 kg, ballasted in 1025, loses 104.1 N and more."""
    given = prior_knowledge.vehicle_file("caribou_nominal")
    assert given.ballast.mass_kg == pytest.approx(640.0, abs=5.0)
    vehicle = replace(given, ballast=replace(given.ballast, net_buoyancy_n=net_buoyancy_n))
    readiness.check_buoyancy("calm", readiness.scenario_content("calm"), vehicle)
    lost_n = given.ballast.mass_kg * 9.80665 * 17.0 / 1025.0 + net_buoyancy_n * 17.0 / 1025.0
    said = f"1008 kg/m3 .* is {lost_n - net_buoyancy_n:.3g} N too heavy"
    with pytest.raises(InputError, match=said):
        readiness.check_buoyancy("estuary", readiness.scenario_content("estuary"), vehicle)


def test_vehicle_lighter_than_surface_water_passes() -> None:
    given = prior_knowledge.vehicle_file("caribou_nominal")
    vehicle = replace(given, ballast=replace(given.ballast, net_buoyancy_n=110.0))
    readiness.check_buoyancy("estuary", readiness.scenario_content("estuary"), vehicle)
