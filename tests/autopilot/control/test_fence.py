"""Geofence and rally points: zones, arming, missions, the action in flight and storage."""

import cmath
import math
import random

import pytest

from autopilot.control import fence, modes, requests
from autopilot.control.fence import Fence, PlanFault
from autopilot.control.params import Config
from autopilot.control.types import ACCEPTED, DENIED, TEMPORARILY_REJECTED, Home
from mavlink_io.frames import offset_to_geodetic
from mavlink_io.mission_items import FENCE_TYPE, RALLY_TYPE, MissionItem
from tests.helpers.missions import Flight, under_way

HOME = Home(42.35, -71.0, known=True)
IN, OUT, CIRCLE_IN, CIRCLE_OUT, RALLY = 5001, 5002, 5003, 5004, 5100


def at(sequence: int, command: int, p1: float, north_m: float, east_m: float) -> MissionItem:
    lat, lon = offset_to_geodetic(north_m, east_m, HOME.lat_deg, HOME.lon_deg)
    kind = RALLY_TYPE if command == RALLY else FENCE_TYPE
    return MissionItem(
        sequence, 0, command, p1=p1, x=round(lat * 1e7), y=round(lon * 1e7), mission_type=kind
    )


def polygon(command: int, *corners: tuple[float, float]) -> tuple[MissionItem, ...]:
    return tuple(at(n, command, len(corners), *corner) for n, corner in enumerate(corners))


SQUARE = polygon(IN, (100.0, -100.0), (100.0, 100.0), (-100.0, 100.0), (-100.0, -100.0))
CONCAVE = ((100.0, -100.0), (0.0, 0.0), (100.0, 100.0), (-100.0, 100.0), (-100.0, -100.0))


def parsed(items: tuple[MissionItem, ...]) -> Fence:
    zones = fence.parse_fence(items)
    assert isinstance(zones, Fence), zones
    return zones


def allowed(items: tuple[MissionItem, ...], north_m: float, east_m: float) -> bool:
    home = HOME.lat_deg, HOME.lon_deg
    return not fence.breach(parsed(items), complex(north_m, east_m), home)


@pytest.mark.parametrize("items", [SQUARE, (*SQUARE, at(4, CIRCLE_OUT, 20.0, 0.0, 50.0))])
def test_circle_is_allowed_where_all_its_points_are(items: tuple[MissionItem, ...]) -> None:
    """Reference: 720 points on each of 120 circles."""
    rng, zones, home = random.Random(5), parsed(items), (HOME.lat_deg, HOME.lon_deg)
    forbidden = 0
    for _ in range(120):
        centre_m = complex(rng.uniform(-90.0, 90.0), rng.uniform(-90.0, 90.0))
        radius_m = rng.uniform(2.0, 90.0)
        points = (centre_m + cmath.rect(radius_m, math.radians(n / 2.0)) for n in range(720))
        expected = any(fence.breach(zones, point, home) for point in points)
        assert bool(fence.circle_breach(zones, centre_m, radius_m, home)) == expected
        forbidden += expected
    assert 20 < forbidden < 110, "both cases were drawn"


@pytest.mark.parametrize(
    ("items", "inside", "outside"),
    [
        (SQUARE, (99.0, -99.0), (101.0, 0.0)),
        (polygon(IN, *CONCAVE), (-50.0, 0.0), (50.0, 0.0)),
        (polygon(OUT, *CONCAVE), (50.0, 0.0), (-50.0, 0.0)),
        ((at(0, CIRCLE_IN, 50.0, 200.0, 0.0),), (160.0, 0.0), (140.0, 0.0)),
        ((at(0, CIRCLE_OUT, 50.0, 0.0, 200.0),), (0.0, 140.0), (0.0, 160.0)),
        ((*SQUARE, at(4, CIRCLE_OUT, 20.0, 0.0, 0.0)), (30.0, 0.0), (10.0, 0.0)),
        ((*SQUARE, at(4, CIRCLE_IN, 50.0, 500.0, 0.0)), (480.0, 0.0), (300.0, 0.0)),
    ],
)
def test_zone_allows_one_side(
    items: tuple[MissionItem, ...], inside: tuple[float, float], outside: tuple[float, float]
) -> None:
    assert allowed(items, *inside)
    assert not allowed(items, *outside)


@pytest.mark.parametrize(
    "items",
    [
        SQUARE[:3],
        (*SQUARE[:3], at(3, OUT, 4, 0.0, 0.0)),
        (at(0, CIRCLE_IN, float("nan"), 0.0, 0.0),),
        (at(0, IN, float("nan"), 0.0, 0.0),),
        (at(0, 16, 0.0, 0.0, 0.0),),
        (at(0, CIRCLE_IN, 10.0, 0.0, 0.0)._replace(frame=2),),
    ],
)
def test_fence_with_fault_is_refused(items: tuple[MissionItem, ...]) -> None:
    assert isinstance(fence.parse_fence(items), PlanFault)


def flight(items: tuple[MissionItem, ...] = SQUARE, **changes: object) -> Flight:
    """Return a vehicle under way at home, heading north, with a geofence."""
    dive = under_way(**changes)  # type: ignore[arg-type]
    dive.state = dive.state._replace(home=HOME)
    assert dive.ask(requests.LoadFence(items)) == ACCEPTED
    return dive


@pytest.mark.parametrize(("action", "mode"), [(1, modes.SURFACE), (2, modes.RTL)])
def test_breach_is_predicted_and_acts(action: int, mode: modes.Mode) -> None:
    """At 1.3 m/s the zone ends FS_LOOK_S = 4 s, or 5 m, ahead of the vehicle."""
    dive = flight(fence_action=action)
    dive.run_until(lambda state: state.failsafe == "geofence", 120.0)
    assert dive.state.mode == mode.number
    assert 90.0 < dive.state.estimate.north_m < 100.0
    assert f"Failsafe: outside the inclusion zones in 4 s -> {mode.name}" in dive.texts()
    assert dive.state.fence_breaches == 1
    assert dive.state.fence_breach_us == dive.state.time_us


def test_breach_report_only_goes_on() -> None:
    dive = flight(fence_action=0)
    for _ in dive.run(120.0):
        pass
    assert dive.state.failsafe == ""
    assert "Geofence: outside the inclusion zones" in dive.texts()
    reports = [text for text in dive.texts() if text.startswith("Geofence: ")]
    assert dive.state.fence_breaches == len(reports) > 1


def test_breach_rtl_goes_to_nearest_allowed_rally_point() -> None:
    dive = flight(fence_action=2)
    points = (
        at(0, RALLY, 0.0, 150.0, 0.0),
        at(1, RALLY, 0.0, 60.0, 30.0),
        at(2, RALLY, 0.0, -80.0, 0.0),
    )
    assert dive.ask(requests.LoadRally(points)) == ACCEPTED
    dive.run_until(lambda state: state.failsafe == "geofence", 120.0)
    path = dive.state.path
    assert path is not None
    assert abs(path.to_m - complex(60.0, 30.0)) < 0.1  # type: ignore[union-attr]


def test_deeper_fault_replaces_breach() -> None:
    dive = flight(fence_action=2)
    dive.run_until(lambda state: state.failsafe == "geofence", 120.0)
    dive.depth_m = 30.0
    dive.run_until(lambda state: state.failsafe not in ("", "geofence"), 12.0)
    assert dive.state.mode == modes.SURFACE.number


def test_arming_outside_fence_is_refused() -> None:
    dive = Flight()
    dive.step()
    far = tuple(at(n, CIRCLE_IN, 50.0, 900.0, 0.0) for n in range(1))
    assert dive.ask(requests.LoadFence(far)) == ACCEPTED
    assert dive.ask(requests.Arm()) == TEMPORARILY_REJECTED, "home is not known"
    dive.state = dive.state._replace(home=HOME)
    assert dive.ask(requests.Arm()) == TEMPORARILY_REJECTED
    assert dive.ask(requests.LoadFence(())) == ACCEPTED
    assert dive.ask(requests.Arm()) == ACCEPTED


def test_fence_that_excludes_vehicle_under_way_is_refused() -> None:
    dive = flight()
    here = (at(0, CIRCLE_OUT, 50.0, 0.0, 0.0),)
    assert dive.ask(requests.LoadFence(here)) == TEMPORARILY_REJECTED
    assert dive.state.fence.items == SQUARE


@pytest.mark.parametrize(
    ("north_m", "depth_m", "accepted"),
    [(80.0, 5.0, True), (150.0, 5.0, False), (80.0, 1.0, False), (80.0, 9.0, False)],
)
def test_mission_leaving_fence_or_depth_band_is_not_started(
    north_m: float, depth_m: float, accepted: bool
) -> None:
    dive = flight(fence_min_m=2.0, fence_max_m=8.0)
    waypoint = MissionItem(0, 1, 16, x=round(north_m * 1e4), y=0, z=depth_m)
    assert dive.ask(requests.LoadMission((waypoint,))) == (ACCEPTED if accepted else DENIED)
    dive.config, dive.state = Config(), dive.state._replace(fence=Fence())
    assert dive.ask(requests.LoadMission((waypoint,))) == ACCEPTED
    dive.config = Config(fence_min_m=2.0, fence_max_m=8.0)
    dive.state = dive.state._replace(fence=parsed(SQUARE))
    expected = ACCEPTED if accepted else TEMPORARILY_REJECTED
    assert dive.ask(requests.SetMode(modes.MISSION.number)) == expected


def test_depth_band_is_a_limit_in_flight() -> None:
    dive = under_way(fence_max_m=8.0)
    assert dive.ask(requests.ChangeTarget(12.0, 0.0, 0.58)) == ACCEPTED
    dive.run_until(lambda state: state.failsafe.startswith("depth"), 60.0)
    assert dive.state.estimate.depth_m < 8.0


def test_fence_refused_leaves_the_old_one() -> None:
    dive = flight()
    assert dive.ask(requests.LoadFence(SQUARE[:2])) == DENIED
    assert dive.state.fence.items == SQUARE
