"""Missions beyond the vehicle's limits are refused before the upload."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from ground.client import flight
from ground.client import vehicle as client
from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.missions import plans, script
from ground.missions.plans import MissionLimits
from ground.missions.script import ScriptError
from mavlink_io.errors import InputError
from mavlink_io.mission_items import NOT_GIVEN, MavCmd, MissionItem
from mavlink_io.services import missions
from mavlink_io.services.mission_server import MissionResult
from tests.ground.fake import FakeVehicle, step_while_waiting

START = "[[step]]\ndepth_m = 4.0\nheading_deg = 0.0\nthrust_pct = 58.0\nduration_s = 30.0\n"
END = "[[step]]\nsurface = true\n"
DEEP = START + "[[step]]\ndepth_m = 25.0\nduration_s = 10.0\n" + END
DEEP_PLACE = START + "[[step]]\nto = [10.0, 0.0]\ndepth_m = 30.0\n" + END
FAR = START + "[[step]]\nto = [12000.0, -5000.0]\n" + END
FAST = START + "[[step]]\nspeed_mps = 2.5\nduration_s = 10.0\n" + END
LIMITS = {
    "FS_DEPTH_M": 18.0,
    "MIS_DIST_MAX": 10_000.0,
    "SPD_CRUISE_MPS": 1.3,
    "THR_CRUISE_PCT": 58.0,
}
ARM = 400


@pytest.fixture(params=[LIMITS])
def fake(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeVehicle]:
    vehicle = FakeVehicle(parameters=request.param)
    monkeypatch.setattr(client, "wait", step_while_waiting(vehicle))
    yield vehicle
    vehicle.close()


@pytest.fixture
def vehicle(fake: FakeVehicle) -> VehicleClient:
    vehicle = VehicleClient(fake.ground_end)
    fake.heartbeat()
    vehicle.connect()
    return vehicle


def dive(folder: Path, text: str, name: str = "m.toml") -> flight.Dive:
    path = folder / name
    path.write_text(text if name.endswith("plan") else f'name = "m"\n{text}')
    return flight.Dive.load(str(path), folder / "m.mcap")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (DEEP, "step 2: depth_m = 25: must be 0 to 18, the vehicle's FS_DEPTH_M"),
        (
            FAST,
            "step 2: speed_mps = 2.5: must be at most 2.24, the vehicle's speed at full thrust"
            " (SPD_CRUISE_MPS, THR_CRUISE_PCT)",
        ),
        (DEEP_PLACE, "step 2: depth_m = 30: must be 0 to 18, the vehicle's FS_DEPTH_M"),
        (
            FAR,
            "step 2: to = [12000, -5000]: 13000 m from home: "
            "must be at most 10000 m, the vehicle's MIS_DIST_MAX",
        ),
    ],
)
def test_mission_beyond_the_vehicles_limits_is_not_uploaded(
    vehicle: VehicleClient, fake: FakeVehicle, tmp_path: Path, text: str, why: str
) -> None:
    with pytest.raises(ScriptError) as refused:
        flight.prepare(vehicle, dive(tmp_path, text))
    assert str(refused.value) == f"{tmp_path / 'm.toml'}: {why}"
    assert fake.store.items == ()
    assert ARM not in [command.command for command in fake.commands]


def test_mission_of_another_file_is_refused_by_its_item(
    vehicle: VehicleClient, fake: FakeVehicle, tmp_path: Path
) -> None:
    items = (MissionItem(0, 2, 93, p1=1.0), MissionItem(1, 3, 16, x=1, y=1, z=-20.0))
    with pytest.raises(
        ScriptError, match="item 1: depth_m = 20: must be 0 to 18, the vehicle's FS_DEPTH_M"
    ):
        flight.prepare(vehicle, dive(tmp_path, plans.write_plan(items), "m.plan"))
    assert fake.store.items == ()


def test_limits_set_before_the_dive_are_those_that_count(
    vehicle: VehicleClient, fake: FakeVehicle, tmp_path: Path
) -> None:
    deep = dive(tmp_path, DEEP)
    flight.prepare(
        vehicle,
        flight.Dive(deep.mission, deep.items, deep.log, {"FS_DEPTH_M": 30.0}, labels=deep.labels),
    )
    assert len(fake.store.items) == len(deep.items)


@pytest.mark.parametrize("fake", [{}], indirect=True)
def test_vehicle_without_such_parameters_sets_no_limit(
    vehicle: VehicleClient, tmp_path: Path
) -> None:
    flight.prepare(vehicle, dive(tmp_path, FAR))
    assert MissionLimits.from_parameters({"MIS_DIST_MAX": 0.0}) == MissionLimits(
        math.inf, math.inf, math.inf
    )


def test_refusal_of_the_vehicle_is_reported_in_its_words(
    vehicle: VehicleClient, fake: FakeVehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reason = "Mission item 4: 15000 m from home: at most 10000"

    def refuse(items: tuple[MissionItem, ...]) -> MissionResult:
        return MissionResult(missions.INVALID_PARAM1 + 4, reason)

    monkeypatch.setattr(fake.store, "load", refuse)
    monkeypatch.setattr(fake.store, "explain", fake.send_text)
    far = START + "[[step]]\nlat_deg = 50.0\nlon_deg = 1.0\n" + END
    with pytest.raises(VehicleClientError, match=rf"MAV_MISSION_INVALID_PARAM5_X \({reason}\)"):
        flight.prepare(vehicle, dive(tmp_path, far))
    assert ARM not in [command.command for command in fake.commands]


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ("1 0 3 16 0 0 0 0 91 0 -4 1", "item 0: latitude 91: must be -90 to 90 deg"),
        ("1 0 3 16 0 0 0 0 0 200 -4 1", "item 0: longitude 200: must be -180 to 180 deg"),
    ],
)
def test_file_with_an_impossible_place_is_refused(tmp_path: Path, row: str, why: str) -> None:
    path = tmp_path / "m.waypoints"
    path.write_text(f"QGC WPL 110\n0 1 0 16 0 0 0 0 0 0 0 1\n{row}\n")
    with pytest.raises(ScriptError, match=why):
        plans.load_items(str(path))


def test_plan_without_a_place_says_so_to_the_vehicle() -> None:
    """null is "not given" (INT32_MAX), not latitude and longitude 0."""
    item = MissionItem(0, 3, 21, 1, x=NOT_GIVEN, y=NOT_GIVEN)
    text = plans.write_plan([item])
    assert text.count("null") == 2
    assert plans.read_plan(text, "m.plan") == (item,)


def test_script_that_names_zero_zero_is_not_taken_for_here() -> None:
    """Exactly 0, 0 means "here" to a vehicle; 1e-7 degrees are 11 mm."""
    text = f'name = "m"\n{START}[[step]]\nlat_deg = 0.0\nlon_deg = 0.0\n{END}'
    place = script.compile_items(script.parse(text, "m"))[-2]
    assert (place.command, place.x, place.y) == (16, 1, 0)


def test_armed_vehicle_keeps_parameters_and_mission(
    vehicle: VehicleClient, fake: FakeVehicle, tmp_path: Path
) -> None:
    fake.modes, fake.custom_mode = (("MISSION", 0, 7),), 7
    fake.heartbeat(armed=True)
    vehicle.pump(0.0)
    other = replace(dive(tmp_path, START + END), parameters={"HDG_P": 0.5})
    with pytest.raises(VehicleClientError, match="the vehicle is already armed, in mode MISSION"):
        flight.prepare(vehicle, other)
    assert (fake.table.values["HDG_P"], fake.store.items) == (0.65, ())
    assert {message.command for message in fake.commands} == {MavCmd.REQUEST_MESSAGE}


def test_mission_beyond_limits_leaves_parameters(
    vehicle: VehicleClient, fake: FakeVehicle, tmp_path: Path
) -> None:
    deep = replace(dive(tmp_path, DEEP), parameters={"HDG_P": 0.5})
    with pytest.raises(ScriptError, match="FS_DEPTH_M"):
        flight.prepare(vehicle, deep)
    assert fake.table.values["HDG_P"] == 0.65


@pytest.mark.parametrize("fake", [{**LIMITS, "MIS_SEQ0_HOME": 1.0}], indirect=True)
def test_vehicle_that_takes_the_first_step_for_home_is_refused(
    vehicle: VehicleClient, fake: FakeVehicle, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="ground params set MIS_SEQ0_HOME 0"):
        flight.prepare(vehicle, dive(tmp_path, START + END))
    assert fake.store.items == ()
