"""A plan as QGroundControl 4.4 writes it: survey, jump, geofence and rally points, flown whole."""

import json
from pathlib import Path
from typing import Any
from unittest.mock import create_autospec

import pytest

from autopilot.control import modes, requests
from autopilot.control.types import ACCEPTED, Home
from ground.client.flight import Dive, prepare
from ground.client.vehicle import VehicleClient
from ground.missions import plans
from ground.missions.script import ScriptError
from mavlink_io.frames import offset_to_geodetic
from mavlink_io.mission_items import FENCE_TYPE, MISSION_TYPE, RALLY_TYPE, MavCmd, MissionItem
from tests.helpers.missions import Flight

HOME = Home(47.3977, 8.5456, True)
CAMERA_TRIGGER, SET_CAMERA_MODE = 206, 530


def degrees(north_m: float, east_m: float) -> list[float]:
    return list(offset_to_geodetic(north_m, east_m, HOME.lat_deg, HOME.lon_deg))


def simple(command: int, jump_id: int, frame: int, *params: float | None) -> dict[str, Any]:
    return {
        "AMSLAltAboveTerrain": None,
        "Altitude": 0,
        "AltitudeMode": 1,
        "autoContinue": True,
        "command": command,
        "doJumpId": jump_id,
        "frame": frame,
        "params": list(params),
        "type": "SimpleItem",
    }


def waypoint(jump_id: int, north_m: float, east_m: float, depth_m: float) -> dict[str, Any]:
    return simple(16, jump_id, 3, 0, 0, 0, None, *degrees(north_m, east_m), -depth_m)


def plan() -> dict[str, Any]:
    """Return the content of a file: a waypoint, a survey of two lines, a jump, the way home."""
    survey = {
        "TransectStyleComplexItem": {
            "CameraCalc": {"CameraName": "Manual (no camera specs)", "version": 2},
            "CameraShots": 4,
            "Items": [
                waypoint(2, 30.0, 0.0, 3.0),
                simple(CAMERA_TRIGGER, 3, 2, 25, 0, 1, 0, 0, 0, 0),
                waypoint(4, 30.0, 40.0, 3.0),
                simple(CAMERA_TRIGGER, 5, 2, 0, 0, 1, 0, 0, 0, 0),
                waypoint(6, 60.0, 40.0, 3.0),
            ],
            "VisualTransectPoints": [],
            "version": 1,
        },
        "angle": 0,
        "complexItemType": "survey",
        "polygon": [degrees(20.0, -10.0), degrees(20.0, 50.0), degrees(70.0, 50.0)],
        "type": "ComplexItem",
        "version": 5,
    }
    return {
        "fileType": "Plan",
        "geoFence": {
            "circles": [
                {
                    "circle": {"center": degrees(150.0, 150.0), "radius": 20.0},
                    "inclusion": False,
                    "version": 1,
                }
            ],
            "polygons": [
                {
                    "inclusion": True,
                    "polygon": [
                        degrees(*corner)
                        for corner in ((-200, -200), (-200, 200), (200, 200), (200, -200))
                    ],
                    "version": 1,
                }
            ],
            "version": 2,
        },
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": 12,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": [
                simple(178, 1, 2, 1, 1.2, -1, 0, 0, 0, 0),
                survey,
                simple(177, 7, 2, 2, 1, 0, 0, 0, 0, 0),
                simple(20, 8, 2, 0, 0, 0, 0, 0, 0, 0),
            ],
            "plannedHomePosition": [*degrees(0.0, 0.0), 0.0],
            "vehicleType": 12,
            "version": 2,
        },
        "rallyPoints": {"points": [[*degrees(10.0, -20.0), 0]], "version": 2},
        "version": 1,
    }


def load(tmp_path: Path, content: dict[str, Any]) -> plans.Plan:
    path = tmp_path / "area.plan"
    path.write_text(json.dumps(content))
    return plans.load(str(path))


def test_plan_is_read_with_survey_jump_fence_and_rally(tmp_path: Path) -> None:
    read = load(tmp_path, plan())
    assert [item.command for item in read.items] == [178, 16, 16, 16, 177, 20]
    assert [item.sequence for item in read.items] == list(range(6))
    assert read.items[4].p1 == 1.0, "doJumpId 2 is the first waypoint of the survey"
    assert [item.command for item in read.fence] == [5001] * 4 + [5004]
    assert [item.p1 for item in read.fence] == [4.0] * 4 + [20.0]
    assert {item.mission_type for item in read.fence} == {FENCE_TYPE}
    (rally,) = read.rally
    assert (rally.command, rally.mission_type) == (MavCmd.NAV_RALLY_POINT, RALLY_TYPE)


def test_dive_of_a_plan_uploads_mission_fence_and_rally(tmp_path: Path) -> None:
    path = tmp_path / "area.plan"
    path.write_text(json.dumps(plan()))
    dive = Dive.load(str(path), tmp_path / "dive.mcap")
    uploaded: dict[int, tuple[MissionItem, ...]] = {}
    vehicle = create_autospec(VehicleClient, instance=True)
    vehicle.parameters.return_value = {}
    vehicle.upload.side_effect = lambda items, kind=MISSION_TYPE: uploaded.update({kind: items})
    prepare(vehicle, dive)
    read = plans.load(str(path))
    assert uploaded == {FENCE_TYPE: read.fence, RALLY_TYPE: read.rally, MISSION_TYPE: read.items}


def test_plan_is_flown_whole(tmp_path: Path) -> None:
    """Every waypoint is reached, those of the jump twice; RTL ends at the rally point."""
    read = load(tmp_path, plan())
    flight = Flight()
    flight.step()
    flight.state = flight.state._replace(home=HOME)
    for request in (
        requests.LoadFence(read.fence),
        requests.LoadRally(read.rally),
        requests.LoadMission(read.items),
        requests.SetMode(modes.MISSION.number),
        requests.Arm(),
    ):
        assert flight.ask(request) == ACCEPTED, (request, flight.texts())
    flight.run_until(lambda state: state.mode == modes.SURFACE.number, 600.0)
    reached = [event.sequence for event in flight.events if hasattr(event, "sequence")]
    assert reached == [0, 1, 2, 3, 4, 1, 2, 3, 4]
    assert "RTL: return point reached" in flight.texts()
    estimate = flight.state.estimate
    assert abs(complex(estimate.north_m, estimate.east_m) - (10.0 - 20.0j)) < 15.0


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
        load(tmp_path, plan() | {part: value})


def test_jump_to_missing_item_is_refused(tmp_path: Path) -> None:
    content = plan()
    content["mission"]["items"][2]["params"][0] = 99
    with pytest.raises(ScriptError, match=r"mission\.items"):
        load(tmp_path, content)


def test_jump_survives_writing_and_reading() -> None:
    items = plans.read_plan(json.dumps(plan()), "area.plan")
    assert plans.read_plan(plans.write_plan(items), "again.plan") == items
