"""A plan file of QGroundControl is read, uploaded and flown whole by the autopilot's tick."""

import json
from pathlib import Path
from typing import Any
from unittest.mock import create_autospec

import pytest

from autopilot.control import modes, requests
from autopilot.control.types import ACCEPTED, Home, ItemReached
from ground.client import flight
from ground.client.flight import Dive, prepare
from ground.client.recorder import Recorder
from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.missions import plans
from ground.missions.script import ScriptError
from mavlink_io.mission_items import FENCE_TYPE, MISSION_TYPE, RALLY_TYPE, MavCmd, MissionItem
from tests.helpers.missions import Flight
from tests.helpers.qgroundcontrol_plan import RALLY_M, REACHED, plan

HOME = Home(47.3977, 8.5456, True)


def load(tmp_path: Path, content: dict[str, Any]) -> plans.Plan:
    path = tmp_path / "area.plan"
    path.write_text(json.dumps(content))
    return plans.load(str(path))


def test_plan_is_read_with_survey_jump_fence_and_rally(tmp_path: Path) -> None:
    read = load(tmp_path, plan(HOME))
    assert [item.command for item in read.items] == [178, 16, 16, 16, 177, 20]
    assert [item.sequence for item in read.items] == list(range(6))
    assert read.items[4].p1 == 1.0, "doJumpId 2 is the first waypoint of the survey"
    assert [item.command for item in read.fence] == [5001] * 4 + [5002] * 3 + [5004, 5003]
    assert [item.p1 for item in read.fence] == [4.0] * 4 + [3.0] * 3 + [20.0, 300.0]
    assert {item.mission_type for item in read.fence} == {FENCE_TYPE}
    (rally,) = read.rally
    assert (rally.command, rally.mission_type) == (MavCmd.NAV_RALLY_POINT, RALLY_TYPE)


def test_dive_of_a_plan_uploads_mission_fence_and_rally(tmp_path: Path) -> None:
    path = tmp_path / "area.plan"
    path.write_text(json.dumps(plan(HOME)))
    dive = Dive.load(str(path), tmp_path / "dive.mcap")
    uploaded: dict[int, tuple[MissionItem, ...]] = {}
    vehicle = create_autospec(VehicleClient, instance=True)
    vehicle.parameters.return_value, vehicle.armed = {}, False
    vehicle.upload.side_effect = lambda items, kind=MISSION_TYPE: uploaded.update({kind: items})
    prepare(vehicle, dive)
    read = plans.load(str(path))
    assert uploaded == {FENCE_TYPE: read.fence, RALLY_TYPE: read.rally, MISSION_TYPE: read.items}


def test_log_of_a_dive_holds_fence_and_rally(tmp_path: Path) -> None:
    """The plan in a log was without them: a dive flown with it had no fence."""
    path = tmp_path / "area.plan"
    path.write_text(json.dumps(plan(HOME)))
    dive = Dive.load(str(path), tmp_path / "dive.mcap")
    vehicle = create_autospec(VehicleClient, instance=True)
    vehicle.connect.side_effect = VehicleClientError("no vehicle")
    recorder = create_autospec(Recorder, instance=True)
    with pytest.raises(VehicleClientError):
        flight._fly(dive, vehicle, recorder, None, None, None)
    name, content, _ = recorder.attach.call_args.args
    assert name == "mission.plan"
    stored = tmp_path / "stored.plan"
    stored.write_bytes(content)
    assert plans.load(str(stored)) == dive.plan


def test_plan_is_flown_whole(tmp_path: Path) -> None:
    """Every waypoint is reached, those of the jump twice; RTL ends at the rally point."""
    read = load(tmp_path, plan(HOME))
    dive = Flight()
    dive.step()
    dive.state = dive.state._replace(home=HOME)
    for request in (
        requests.LoadFence(read.fence),
        requests.LoadRally(read.rally),
        requests.LoadMission(read.items),
        requests.SetMode(modes.MISSION.number),
        requests.Arm(),
    ):
        assert dive.ask(request) == ACCEPTED, (request, dive.texts())
    dive.run_until(lambda state: state.mode == modes.SURFACE.number, 600.0)
    assert "RTL: return point reached" in dive.texts()
    estimate = dive.state.estimate
    assert abs(complex(estimate.north_m, estimate.east_m) - complex(*RALLY_M)) < 15.0
    dive.run_until(lambda state: not state.armed, 60.0)
    reached = [event.sequence for event in dive.events if isinstance(event, ItemReached)]
    assert reached == list(REACHED)


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        ("geoFence", {"polygons": [{"inclusion": True}]}, "geoFence: not a QGroundControl plan"),
        ("geoFence", {"circles": [{"circle": {"center": [1, 2]}}]}, "geoFence"),
        ("geoFence", {"circles": [{"circle": {"center": [900, 2], "radius": 1}}]}, "place 900, 2"),
        ("rallyPoints", {"points": [[1.0]]}, "rallyPoints: not a QGroundControl plan"),
        ("rallyPoints", 7, "rallyPoints"),
    ],
)
def test_wrong_part_of_plan_is_named(tmp_path: Path, part: str, value: Any, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        load(tmp_path, plan(HOME) | {part: value})


def test_jump_to_missing_item_is_refused(tmp_path: Path) -> None:
    content = plan(HOME)
    content["mission"]["items"][2]["params"][0] = 99
    with pytest.raises(ScriptError, match=r"mission\.items\[2\]: .* no item has the doJumpId 99"):
        load(tmp_path, content)


def test_jump_survives_writing_and_reading() -> None:
    items = plans.read_plan(json.dumps(plan(HOME)), "area.plan")
    assert plans.read_plan(plans.write_plan(items), "again.plan") == items
