"""A plan file as QGroundControl writes it: survey, jump, geofence and rally points.

Format: QGroundControl's developer guide, "Plan File Format"; a survey holds its items in
``TransectStyleComplexItem``, and param1 of DO_JUMP is a ``doJumpId``.
"""

from collections.abc import Sequence
from typing import Any

from autopilot.control.types import Home
from mavlink_io.frames import offset_to_geodetic

CAMERA_TRIGGER = 206
WAYPOINTS_M = ((30.0, 0.0), (30.0, 40.0), (60.0, 40.0))
"""North and east of the waypoints of the survey, from home."""
SURVEY_DEPTH_M = 3.0
KEEP_OUT_M = ((-50.0, 30.0), (-50.0, 60.0), (-80.0, 30.0))
"""Corners of the exclusion polygon, away from every line."""
RALLY_M = (10.0, -20.0)
REACHED = (0, 1, 2, 3, 4, 1, 2, 3, 4, 5)
"""Items that are reached, in order: the jump repeats the survey once; RTL ends at the surface."""


def degrees(home: Home, north_m: float, east_m: float) -> list[float]:
    """Return latitude and longitude of a place in metres from home."""
    return list(offset_to_geodetic(north_m, east_m, home.lat_deg, home.lon_deg))


def simple(command: int, jump_id: int, frame: int, *params: float | None) -> dict[str, Any]:
    """Return a simple item."""
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


def plan(home: Home, keep_out_m: Sequence[tuple[float, float]] = KEEP_OUT_M) -> dict[str, Any]:
    """Return the content of a file: a speed, a survey of two lines, a jump, the way home."""

    def place(north_m: float, east_m: float) -> list[float]:
        return degrees(home, north_m, east_m)

    def waypoint(jump_id: int, north_m: float, east_m: float) -> dict[str, Any]:
        return simple(16, jump_id, 3, 0, 0, 0, None, *place(north_m, east_m), -SURVEY_DEPTH_M)

    def circle(north_m: float, east_m: float, radius_m: float, inclusion: bool) -> dict[str, Any]:
        area = {"center": place(north_m, east_m), "radius": radius_m}
        return {"circle": area, "inclusion": inclusion, "version": 1}

    def polygon(inclusion: bool, *corners_m: tuple[float, float]) -> dict[str, Any]:
        corners = [place(*corner_m) for corner_m in corners_m]
        return {"inclusion": inclusion, "polygon": corners, "version": 1}

    survey = {
        "TransectStyleComplexItem": {
            "CameraCalc": {"CameraName": "Manual (no camera specs)", "version": 2},
            "CameraShots": 4,
            "Items": [
                waypoint(2, *WAYPOINTS_M[0]),
                simple(CAMERA_TRIGGER, 3, 2, 25, 0, 1, 0, 0, 0, 0),
                waypoint(4, *WAYPOINTS_M[1]),
                simple(CAMERA_TRIGGER, 5, 2, 0, 0, 1, 0, 0, 0, 0),
                waypoint(6, *WAYPOINTS_M[2]),
            ],
            "VisualTransectPoints": [],
            "version": 1,
        },
        "angle": 0,
        "complexItemType": "survey",
        "polygon": [place(20.0, -10.0), place(20.0, 50.0), place(70.0, 50.0)],
        "type": "ComplexItem",
        "version": 5,
    }
    return {
        "fileType": "Plan",
        "geoFence": {
            "circles": [circle(150.0, 150.0, 20.0, False), circle(0.0, 0.0, 300.0, True)],
            "polygons": [
                polygon(True, (-200, -200), (-200, 200), (200, 200), (200, -200)),
                polygon(False, *keep_out_m),
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
            "plannedHomePosition": [*place(0.0, 0.0), 0.0],
            "vehicleType": 12,
            "version": 2,
        },
        "rallyPoints": {"points": [[*place(*RALLY_M), 0]], "version": 2},
        "version": 1,
    }
