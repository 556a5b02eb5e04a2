"""Tests of a mission with a simulated vehicle: `pip install caribou-auv pytest`, then `pytest`."""

from pathlib import Path

import pytest

SURVEY = Path(__file__).with_name("survey.toml")
TRIMS = {"TRIM_RUD_DEG": 6.0, "TRIM_ELE_DEG": 0.3}  # found by the mission `trim`


@pytest.mark.caribou(parameters=TRIMS)
def test_survey_holds_depth_and_heading(caribou_vehicle):
    dive = caribou_vehicle.fly(SURVEY)
    assert not dive.failsafes
    assert dive.errors.depth_m < 0.5
    assert dive.errors.heading_deg < 3.0


@pytest.mark.caribou(parameters=TRIMS, faults=[{"at_s": 40.0, "unit": "leak", "kind": "wet"}])
def test_survey_with_a_leak_ends_at_the_surface(caribou_vehicle):
    dive = caribou_vehicle.fly(SURVEY)
    assert ["Leak detected" in reason for reason in dive.failsafes] == [True]
    assert dive.log.depth.depth_m[-1] < 1.0
