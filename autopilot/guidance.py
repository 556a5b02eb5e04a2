"""From a place to a course."""

import math

from autopilot.types import Estimate, Home
from link.frames import geodetic_to_offset
from link.missions import MissionItem

GLOBAL_FRAMES = (0, 3, 5, 6)
LOCAL_NED = 1
DEFAULT_ACCEPTANCE_M = 5.0


def target(item: MissionItem, home: Home, estimate: Estimate) -> tuple[float, float, float]:
    """North, east and depth in metres from home of a waypoint; zero latitude and longitude mean here."""
    if item.frame == LOCAL_NED:
        return item.x * 1e-4, item.y * 1e-4, item.z
    depth = estimate.depth_m if math.isnan(item.z) else -item.z
    if item.x == 0 and item.y == 0:
        return estimate.north_m, estimate.east_m, depth
    north, east = geodetic_to_offset(item.x * 1e-7, item.y * 1e-7, home.lat_deg, home.lon_deg)
    return north, east, depth


def distance_m(north_m: float, east_m: float, estimate: Estimate) -> float:
    return math.hypot(north_m - estimate.north_m, east_m - estimate.east_m)


def bearing_rad(north_m: float, east_m: float, estimate: Estimate) -> float:
    """Course from the vehicle to a place, clockwise from north."""
    return math.atan2(east_m - estimate.east_m, north_m - estimate.north_m)
