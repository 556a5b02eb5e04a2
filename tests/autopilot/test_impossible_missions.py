"""Missions that cannot be flown are refused at the upload, and again at the start."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import guidance, mission, modes, requests
from autopilot.control.params import Config
from autopilot.control.types import ACCEPTED, DENIED, TEMPORARILY_REJECTED, Home
from mavlink_io.mission_items import NOT_GIVEN, MissionItem
from mavlink_io.records import GpsFix
from tests.helpers.fake_hil import Harness, texts
from tests.helpers.missions import Flight, leg

WAYPOINT, LOITER, LAND, DELAY, CHANGE_ALTITUDE, WAIT, JUMP = 16, 19, 21, 93, 186, 113, 177
HOME = Home(42.35, -71.0, True)
PARAM1, PARAM5, PARAM6, PARAM7 = 6, 10, 11, 12
"""Values from MAV_MISSION_INVALID_PARAM1."""
UNSUPPORTED = 3
NAN = math.nan
NORTH_M_PER_DEG = 6_371_000.0 * math.pi / 180.0
"""Length of a degree of latitude (m) on the sphere of ``mavlink_io.frames``."""


def waypoint(
    lat_deg: float = 42.351, lon_deg: float = -71.0, depth_m: float = 4.0, command: int = WAYPOINT
) -> Any:
    return MissionItem(0, 6, command, x=round(lat_deg * 1e7), y=round(lon_deg * 1e7), z=-depth_m)


@pytest.fixture
def harness() -> Harness:
    harness = Harness()
    harness.tick(3, fix=GpsFix(0, 3, HOME.lat_deg, HOME.lon_deg, 0.0, 0.0, 0.0, 0.0, 9))
    harness.serve()
    harness.station.pop_received()
    return harness


def upload(harness: Harness, *items: MissionItem) -> tuple[int, list[str]]:
    """Return the MISSION_ACK of an upload, and the texts that were sent."""
    received = harness.ask(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for n, i in enumerate(items):
        fields = (
            1,
            1,
            n,
            i.frame,
            i.command,
            int(n == 0),
            1,
            i.p1,
            i.p2,
            i.p3,
            i.p4,
            i.x,
            i.y,
            i.z,
            0,
        )
        received += harness.ask(mavlink.MAVLink_mission_item_int_message(*fields))
    (ack,) = [m for m in received if m.get_type() == "MISSION_ACK"]
    return ack.type, texts(received)


IMPOSSIBLE: list[tuple[MissionItem, int, str]] = [
    (waypoint(lat_deg=91.0), PARAM5, "latitude 91: must be -90 to 90 deg"),
    (waypoint(lat_deg=-90.0000001), PARAM5, "latitude -90.0000001: must be -90 to 90 deg"),
    (waypoint(lon_deg=200.0), PARAM6, "longitude 200: must be -180 to 180 deg"),
    (waypoint(lat_deg=95.0, command=LAND), PARAM5, "latitude 95: must be -90 to 90 deg"),
    (waypoint()._replace(x=NOT_GIVEN), PARAM5, "latitude and longitude: give both or none"),
    (waypoint()._replace(y=NOT_GIVEN), PARAM6, "latitude and longitude: give both or none"),
    (waypoint(depth_m=18.1), PARAM7, "depth 18.1 m: must be at most FS_DEPTH_M = 18 m"),
    (MissionItem(0, 1, WAYPOINT, z=30.0), PARAM7, "depth 30 m: must be at most FS_DEPTH_M = 18 m"),
    (MissionItem(0, 3, WAIT, z=-25.0), PARAM7, "depth 25 m: must be at most FS_DEPTH_M = 18 m"),
    (
        MissionItem(0, 2, CHANGE_ALTITUDE, p1=-25.0),
        PARAM1,
        "depth 25 m: must be at most FS_DEPTH_M = 18 m",
    ),
    (waypoint(lat_deg=42.46), PARAM5, "12231 m from home: must be at most MIS_DIST_MAX = 10000 m"),
    (
        MissionItem(0, 1, LOITER, p1=5.0, y=-200_000_000, z=2.0),
        PARAM6,
        "20000 m from home: must be at most MIS_DIST_MAX = 10000 m",
    ),
    (
        MissionItem(0, 1, LOITER, p1=5.0, p3=-1.0, z=2.0),
        PARAM1 + 2,
        "radius -1 m: must be 0 or at least 6 m, the turning circle (TURN_RADIUS_M)",
    ),
    (
        MissionItem(0, 2, JUMP, p1=1.0, p2=-1.0),
        PARAM1,
        "DO_JUMP repeats items that take no time",
    ),
    (MissionItem(0, 2, DELAY, p1=NAN), PARAM1, "p1 of command 93: must be a number"),
    (waypoint()._replace(z=-math.inf), PARAM7, "z of command 16: must be finite"),
    (waypoint()._replace(p4=math.inf), 9, "p4 of command 16: must be finite"),
    (MissionItem(0, 3, 22), UNSUPPORTED, "command 22 is not one this vehicle flies"),
]


@pytest.mark.parametrize(("item", "result", "why"), IMPOSSIBLE)
def test_impossible_item_is_refused_at_upload_by_its_field(
    harness: Harness, item: MissionItem, result: int, why: str
) -> None:
    assert upload(harness, waypoint()) == (0, [])
    assert upload(harness, waypoint(), item, waypoint()) == (result, [f"Mission item 1: {why}"])
    assert len(harness.vehicle.state.mission.items) == 1, "the old mission stays"


@pytest.mark.parametrize(
    "item",
    [
        waypoint(depth_m=18.0),
        MissionItem(0, 1, LOITER, p1=5.0, p3=6.0, z=2.0),
        waypoint(lat_deg=42.35 + 9_900.0 / NORTH_M_PER_DEG),
        waypoint()._replace(x=NOT_GIVEN, y=NOT_GIVEN),
        waypoint()._replace(x=0, y=0),
        waypoint()._replace(p1=NAN, p2=NAN, p3=NAN, p4=NAN, z=NAN),
        MissionItem(0, 2, CHANGE_ALTITUDE, p1=-18.0),
    ],
)
def test_possible_item_at_the_limit_is_accepted(harness: Harness, item: MissionItem) -> None:
    assert upload(harness, item) == (0, [])


def test_depth_limit_accepts_float32_rounding(harness: Harness) -> None:
    """18.1 is a double in a parameter file; the float32 of an item is 4e-7 m deeper."""
    harness.vehicle.params.set("FS_DEPTH_M", 18.1)
    assert upload(harness, waypoint(depth_m=18.1)) == (0, [])


def disarmed_in_mission(*items: MissionItem, home: Home = HOME, **changes: Any) -> Flight:
    """Return a disarmed vehicle in MISSION with a loaded mission."""
    flight = Flight(config=Config(**changes))
    flight.step()
    flight.state = flight.state._replace(home=home)
    assert flight.ask(requests.LoadMission(items)) == ACCEPTED
    assert flight.ask(requests.SetMode(modes.MISSION.number)) == ACCEPTED
    return flight


def test_mission_deeper_than_a_limit_set_later_is_not_started() -> None:
    flight = disarmed_in_mission(*leg(depth_m=12, heading_deg=0, duration_s=60))
    flight.config = Config(fs_depth_m=10.0)
    assert flight.ask(requests.Arm()) == TEMPORARILY_REJECTED
    assert not flight.state.armed
    flight.ask(requests.SetMode(modes.DEPTH.number))
    assert flight.ask(requests.Arm()) == ACCEPTED
    assert flight.ask(requests.SetMode(modes.MISSION.number)) == TEMPORARILY_REJECTED
    assert flight.state.mode == modes.DEPTH.number
    flight.config = Config()
    assert flight.ask(requests.SetMode(modes.MISSION.number)) == ACCEPTED


def test_mission_loaded_before_home_is_checked_at_start() -> None:
    flight = disarmed_in_mission(waypoint(lat_deg=47.0), home=Home())
    assert flight.ask(requests.Arm()) == TEMPORARILY_REJECTED
    flight.state = flight.state._replace(home=HOME)
    assert flight.ask(requests.Arm()) == TEMPORARILY_REJECTED
    assert not flight.state.armed
    flight.config = Config(mission_distance_m=0.0)
    assert flight.ask(requests.Arm()) == TEMPORARILY_REJECTED, "517 km are beyond the battery"
    flight.config = Config(mission_distance_m=0.0, battery_cruise_h=0.0)
    assert flight.ask(requests.Arm()) == ACCEPTED, "0 is no limit"


def test_refusal_to_start_names_item_value_and_limit(harness: Harness) -> None:
    upload(harness, waypoint(), waypoint(depth_m=12.0))
    harness.command(176, 1, float(modes.MISSION.number))
    harness.vehicle.params.set("FS_DEPTH_M", 10.0)
    assert texts(harness.command(400, 1)) == [
        "Not armed: mission item 1: depth 12 m: must be at most FS_DEPTH_M = 10 m"
    ]
    harness.vehicle.params.set("FS_DEPTH_M", 18.0)
    harness.vehicle.params.set("MIS_DIST_MAX", 100.0)
    assert texts(harness.command(400, 1)) == [
        "Not armed: mission item 0: 111 m from home: must be at most MIS_DIST_MAX = 100 m"
    ]


def test_restart_keeps_mission_beyond_new_limit(harness: Harness) -> None:
    upload(harness, waypoint(depth_m=12.0))
    harness.vehicle.params.set("FS_DEPTH_M", 10.0)
    harness.vehicle.restart("a test")
    assert len(harness.vehicle.state.mission.items) == 1


def test_command_deeper_than_the_failsafe_is_refused() -> None:
    flight = Flight(config=Config(fs_depth_m=10.0))
    item = MissionItem(0, 2, CHANGE_ALTITUDE, p1=-12.0)
    assert mission.check((item,), flight.config) == (
        0,
        "depth 12 m: must be at most FS_DEPTH_M = 10 m",
    )


def test_position_zero_zero_is_valid_only_near_home() -> None:
    """ArduPilot reads 0, 0 as the present position; near (0, 0) it is a position."""
    zero = MissionItem(0, 3, WAYPOINT, z=-4.0)
    assert guidance.item_position(zero, HOME) is None
    assert guidance.item_position(zero, Home()) is None
    near = guidance.item_position(zero, Home(0.009, -0.009, True))
    assert near == pytest.approx(complex(-0.009, 0.009) * NORTH_M_PER_DEG, abs=1e-3)
    assert guidance.item_position(zero, Home(0.0, 0.0, True)) == 0j
    assert guidance.item_position(zero, Home(1.0, 0.0, True)) is None  # 111 km
    assert guidance.item_position(zero._replace(x=1), HOME) is not None


def test_mission_at_zero_zero_is_flown() -> None:
    """A vehicle 400 m north of home at (0, 0) turns south; an earlier version circled in place."""
    north = Home(400.0 / NORTH_M_PER_DEG, 0.0, True)
    flight = disarmed_in_mission(MissionItem(0, 3, WAYPOINT, z=-4.0), home=north)
    assert flight.ask(requests.Arm()) == ACCEPTED
    flight.step()
    assert flight.state.path is not None
    assert flight.state.path.to_m == pytest.approx(-400.0, abs=0.01)  # type: ignore[union-attr]


def test_position_beyond_antimeridian_is_near() -> None:
    """0.02 degrees of longitude on the equator are 2224 m, also across 180 degrees."""
    fiji = Home(0.0, 179.99, True)
    place = guidance.item_position(waypoint(lat_deg=0.0, lon_deg=-179.99), fiji)
    assert place == pytest.approx(0.02j * NORTH_M_PER_DEG, abs=0.01)


def set_home(harness: Harness, *parameters: float) -> tuple[int, list[str]]:
    received = harness.command(179, *parameters)
    (ack,) = [m for m in received if m.get_type() == "COMMAND_ACK"]
    return ack.result, texts(received)


def test_home_at_zero_zero_from_afar_is_refused(harness: Harness) -> None:
    """Clients send zeros when no position is entered."""
    before = harness.vehicle.state.home
    assert set_home(harness, 0, 0, 0, 0, 0.0, 0.0, 0.0) == (
        DENIED,
        ["Home refused: 0, 0 means no position unless home is within 100 km of it"],
    )
    assert harness.vehicle.state.home == before
    assert set_home(harness, 0, 0, 0, 0, 0.5, 0.0, 0.0)[0] == ACCEPTED
    assert set_home(harness, 0, 0, 0, 0, 0.0, 0.0, 0.0)[0] == ACCEPTED
    assert harness.vehicle.state.home == Home(0.0, 0.0, True)


def test_home_at_unknown_position_is_refused() -> None:
    """An earlier version set home to 0, 0, the position reported while none is known."""
    harness = Harness()
    harness.tick(3)
    assert set_home(harness, 1) == (
        TEMPORARILY_REJECTED,
        ["Home refused: the position is not known"],
    )
    assert not harness.vehicle.state.home.known
    assert set_home(harness, 0, 0, 0, 0, 0.0, 0.0, 0.0)[0] == ACCEPTED, "near 0, 0 it is a position"
