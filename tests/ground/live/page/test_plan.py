"""Waypoints and fence in metres, and their download by an observer."""

from contextlib import closing

import pytest

from ground.live.page import plan
from ground.live.page.plan import DrawnZone, Origin, PlanReader, Waypoint
from mavlink_io.endpoint import Endpoint
from mavlink_io.mission_items import FENCE_TYPE, MavCmd, MissionItem
from mavlink_io.request import MavlinkId
from mavlink_io.transport import open_transport

LOCAL, GLOBAL = 1, 3
HOME = Origin(42.0, -71.0)
METRES_PER_DEGREE = 6_371_000.0 * 3.141592653589793 / 180.0
"""Length of a degree of latitude on the sphere of the vehicle's LOCAL_POSITION_NED."""


def vertex(index: int, lat_deg: float, lon_deg: float, count: float = 3.0) -> MissionItem:
    return MissionItem(
        index,
        GLOBAL,
        MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
        p1=count,
        x=round(lat_deg * 1e7),
        y=round(lon_deg * 1e7),
        mission_type=FENCE_TYPE,
    )


def test_local_waypoint_is_drawn_without_an_origin() -> None:
    items = [
        MissionItem(0, 2, MavCmd.DO_CHANGE_SPEED),
        MissionItem(1, LOCAL, MavCmd.NAV_WAYPOINT, x=1_000_000, y=-500_000),
    ]
    assert plan.draw(items, None).waypoints == [Waypoint(1, 100.0, -50.0)]


def test_global_waypoint_needs_the_origin() -> None:
    item = MissionItem(0, GLOBAL, MavCmd.NAV_WAYPOINT, x=420_010_000, y=-710_000_000)
    assert plan.draw([item], None).waypoints == []
    (waypoint,) = plan.draw([item], HOME).waypoints
    assert waypoint.north_m == pytest.approx(0.001 * METRES_PER_DEGREE, rel=1e-6)
    assert waypoint.east_m == pytest.approx(0.0, abs=1e-6)


def test_waypoint_at_the_present_position_is_left_out() -> None:
    item = MissionItem(0, GLOBAL, MavCmd.NAV_WAYPOINT, x=0, y=0)
    assert plan.draw([item], HOME).waypoints == []


def test_origin_moved_and_measured_agree() -> None:
    moved = HOME.moved(120.0, -40.0)
    assert HOME.local_m(*moved) == pytest.approx((120.0, -40.0), rel=1e-9)


def test_place_across_the_antimeridian_is_near() -> None:
    origin = Origin(0.0, 179.9999)
    _, east_m = origin.local_m(0.0, -179.9999)
    assert east_m == pytest.approx(0.0002 * METRES_PER_DEGREE, rel=1e-6)


def test_fence_has_polygons_and_circles() -> None:
    circle = MissionItem(
        3, LOCAL, MavCmd.NAV_FENCE_CIRCLE_INCLUSION, p1=80.0, mission_type=FENCE_TYPE
    )
    triangle = [vertex(0, 42.0, -71.0), vertex(1, 42.001, -71.0), vertex(2, 42.0, -70.999)]
    polygon, zone = plan.draw([*triangle, circle], HOME).zones
    assert zone == DrawnZone(True, [(0.0, 0.0)], 80.0)
    assert not polygon.inclusion
    assert polygon.points[1] == pytest.approx((0.001 * METRES_PER_DEGREE, 0.0), abs=1e-6)


def test_plan_reader_reads_mission_and_fence() -> None:
    own, vehicle_id = MavlinkId(250, 155), MavlinkId(1, 1)
    name = "memory:plan-reader"
    with closing(open_transport(name)) as ground_end, closing(open_transport(name)) as vehicle_end:
        ground, vehicle = Endpoint(ground_end, *own), Endpoint(vehicle_end, *vehicle_id)
        reader = PlanReader(ground.send, own, vehicle_id)
        addressed = {"target_system": own.system, "target_component": own.component}
        for _ in range(8):
            reader.poll()
            for received in vehicle.receive():
                message = received.decode()
                if received.name == "MISSION_REQUEST_LIST":
                    vehicle.send(
                        "MISSION_COUNT",
                        count=1,
                        mission_type=message.mission_type,
                        **addressed,
                    )
                elif received.name == "MISSION_REQUEST_INT":
                    is_fence = message.mission_type == FENCE_TYPE
                    command = MavCmd.NAV_FENCE_CIRCLE_INCLUSION if is_fence else MavCmd.NAV_WAYPOINT
                    vehicle.send(
                        "MISSION_ITEM_INT",
                        seq=0,
                        frame=LOCAL,
                        command=command,
                        current=0,
                        autocontinue=1,
                        param1=50.0,
                        param2=0.0,
                        param3=0.0,
                        param4=0.0,
                        x=10_000,
                        y=0,
                        z=0.0,
                        mission_type=message.mission_type,
                        **addressed,
                    )
            for answer in ground.receive():
                reader.feed(answer)
    drawn = plan.draw(reader.items, None)
    assert drawn.waypoints == [Waypoint(0, 1.0, 0.0)]
    assert drawn.zones == [DrawnZone(True, [(1.0, 0.0)], 50.0)]
