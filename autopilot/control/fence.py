"""Geofence and rally points: their items, and whether a position is allowed. Pure.

A position is allowed inside at least one inclusion zone, if there is any, and outside every
exclusion zone. Positions are complex numbers, north + i east from home (m).
"""

import cmath
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

from mavlink_io.frames import geodetic_to_offset
from mavlink_io.mission_items import GLOBAL_FRAMES, GLOBAL_SCALE, MavCmd, MissionItem, place_fault

VERTICES = frozenset(
    (MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION, MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION)
)
CIRCLES = frozenset((MavCmd.NAV_FENCE_CIRCLE_INCLUSION, MavCmd.NAV_FENCE_CIRCLE_EXCLUSION))
_INCLUSIONS = frozenset(
    (MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION, MavCmd.NAV_FENCE_CIRCLE_INCLUSION)
)
MIN_VERTICES = 3
"""Minimum number of vertices of a polygon."""
EDGE_M = 0.01
"""Length below which a part of a line is not checked: a line may touch an edge."""
MAX_RADIUS_M = 100_000.0
"""Maximum radius of a circle: the projection is that of a flat earth."""


class Place(NamedTuple):
    """A point on the surface."""

    lat_deg: float
    lon_deg: float

    def offset_m(self, home_lat_deg: float, home_lon_deg: float) -> complex:
        """Return the position, north + i east from home (m)."""
        return complex(*geodetic_to_offset(*self, home_lat_deg, home_lon_deg))


class Zone(NamedTuple):
    """A polygon, or a circle about its only point."""

    inclusion: bool
    points: tuple[Place, ...]
    radius_m: float = 0.0
    """0 for a polygon."""


class Fence(NamedTuple):
    """Zones of a geofence, with the items that they came from."""

    items: tuple[MissionItem, ...] = ()
    zones: tuple[Zone, ...] = ()


class Rally(NamedTuple):
    """Rally points, with the items that they came from."""

    items: tuple[MissionItem, ...] = ()
    places: tuple[Place, ...] = ()


class PlanFault(NamedTuple):
    """First reason why a plan is refused."""

    sequence: int
    reason: str
    parameter: int = 0
    """Number of the wrong parameter, 1 to 7; 0 for none in particular."""
    unknown: bool = False
    """Whether the command is not one of this kind of plan."""


def parse_fence(items: Sequence[MissionItem]) -> Fence | PlanFault:
    """Return the geofence of the items of a plan, or their first fault.

    Parameters
    ----------
    items : sequence of MissionItem
        Vertices of a polygon follow each other; p1 is the number of vertices, or the radius (m).

    Returns
    -------
    Fence or PlanFault
        The geofence, or the reason of the refusal.
    """
    zones: list[Zone] = []
    position = 0
    while position < len(items):
        item = items[position]
        count = 1
        if item.command in VERTICES:
            count = int(item.p1) if math.isfinite(item.p1) else 0
            group = items[position : position + count]
            if count < MIN_VERTICES or len(group) < count:
                reason = f"polygon of {item.p1:g} vertices: must be {MIN_VERTICES} to those sent"
                return PlanFault(item.sequence, reason, 1)
            if any((other.command, other.p1) != (item.command, item.p1) for other in group):
                return PlanFault(item.sequence, f"polygon: {count} vertices must follow", 1)
        elif item.command in CIRCLES:
            if not 0.0 < item.p1 <= MAX_RADIUS_M:
                reason = f"radius {item.p1:g} m: must be above 0, at most {MAX_RADIUS_M:g}"
                return PlanFault(item.sequence, reason, 1)
        else:
            reason = f"command {item.command} is not an item of a fence"
            return PlanFault(item.sequence, reason, unknown=True)
        group = items[position : position + count]
        if fault := _place_fault(group):
            return fault
        radius_m = item.p1 if item.command in CIRCLES else 0.0
        zones.append(Zone(item.command in _INCLUSIONS, tuple(map(_place, group)), radius_m))
        position += count
    return Fence(tuple(items), tuple(zones))


def parse_rally(items: Sequence[MissionItem]) -> Rally | PlanFault:
    """Return the rally points of the items of a plan, or their first fault.

    Parameters
    ----------
    items : sequence of MissionItem
        Items of a rally plan; their altitude has no meaning for a vehicle that surfaces there.

    Returns
    -------
    Rally or PlanFault
        The rally points, or the reason of the refusal.
    """
    for item in items:
        if item.command != MavCmd.NAV_RALLY_POINT:
            reason = f"command {item.command} is not a rally point"
            return PlanFault(item.sequence, reason, unknown=True)
    if fault := _place_fault(items):
        return fault
    return Rally(tuple(items), tuple(map(_place, items)))


def _place_fault(items: Sequence[MissionItem]) -> PlanFault | None:
    """Return the first fault of the positions of items."""
    for item in items:
        if item.frame not in GLOBAL_FRAMES:
            return PlanFault(item.sequence, f"frame {item.frame}: must have latitude and longitude")
        parameter, reason = place_fault(item)
        if reason:
            return PlanFault(item.sequence, reason, parameter)
    return None


def _place(item: MissionItem) -> Place:
    """Return the point of an item."""
    return Place(item.x / GLOBAL_SCALE, item.y / GLOBAL_SCALE)


def breach(fence: Fence, position_m: complex, home_deg: tuple[float, float]) -> str:
    """Return which zone forbids a position.

    Parameters
    ----------
    fence : Fence
        Geofence.
    position_m : complex
        Position, north + i east from home (m).
    home_deg : tuple of 2 floats
        Latitude and longitude of home.

    Returns
    -------
    str
        The zone with its number; empty for an allowed position.
    """
    inside_any, inclusions = False, 0
    for number, zone in enumerate(fence.zones):
        corners = [place.offset_m(*home_deg) for place in zone.points]
        inside = (
            abs(position_m - corners[0]) < zone.radius_m
            if zone.radius_m
            else inside_polygon(position_m, corners)
        )
        if inside and not zone.inclusion:
            return f"inside exclusion zone {number}"
        inclusions += zone.inclusion
        inside_any = inside_any or (inside and zone.inclusion)
    return "outside the inclusion zones" if inclusions and not inside_any else ""


def line_breach(fence: Fence, from_m: complex, to_m: complex, home_deg: tuple[float, float]) -> str:
    """Return which zone forbids a part of a line.

    The line is divided where it crosses the edge of a zone, and each part is checked at its middle.

    Parameters
    ----------
    fence : Fence
        Geofence.
    from_m, to_m : complex
        Ends of the line, north + i east from home (m).
    home_deg : tuple of 2 floats
        Latitude and longitude of home.

    Returns
    -------
    str
        The zone with its number; empty for an allowed line.
    """
    crossings = {0.0, 1.0}
    for zone in fence.zones:
        corners = [place.offset_m(*home_deg) for place in zone.points]
        if zone.radius_m:
            crossings |= _circle_crossings(from_m, to_m, corners[0], zone.radius_m)
        else:
            crossings |= _polygon_crossings(from_m, to_m, corners)
    shares = sorted(crossings)
    for start, end in itertools.pairwise(shares):
        middle_m = from_m + 0.5 * (start + end) * (to_m - from_m)
        if (end - start) * abs(to_m - from_m) > EDGE_M and (
            text := breach(fence, middle_m, home_deg)
        ):
            return text
    return ""


def circle_breach(
    fence: Fence, centre_m: complex, radius_m: float, home_deg: tuple[float, float]
) -> str:
    """Return which zone forbids a part of a circle that the vehicle flies.

    The circle is divided where it crosses the edge of a zone, and each arc is checked at its
    middle.

    Parameters
    ----------
    fence : Fence
        Geofence.
    centre_m : complex
        Centre, north + i east from home (m).
    radius_m : float
        Radius of the circle (m).
    home_deg : tuple of 2 floats
        Latitude and longitude of home.

    Returns
    -------
    str
        The zone with its number; empty for an allowed circle.
    """
    angles = {-math.pi}
    for zone in fence.zones:
        corners = [place.offset_m(*home_deg) for place in zone.points]
        if zone.radius_m:
            angles |= _angles_on_circle(centre_m, radius_m, corners[0], zone.radius_m)
            continue
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True):
            shares = _circle_crossings(a, b, centre_m, radius_m)
            angles |= {cmath.phase(a + share * (b - a) - centre_m) for share in shares}
    ordered = sorted(angles)
    for start, end in itertools.pairwise((*ordered, ordered[0] + 2.0 * math.pi)):
        middle_m = centre_m + cmath.rect(radius_m, 0.5 * (start + end))
        if (end - start) * radius_m > EDGE_M and (text := breach(fence, middle_m, home_deg)):
            return text
    return ""


def _angles_on_circle(
    centre_m: complex, radius_m: float, other_m: complex, other_radius_m: float
) -> set[float]:
    """Return the directions from a centre in which its circle crosses another one.

    With the distance d of the centres, cos a = (r^2 + d^2 - R^2) / (2 r d), a from the line of the
    centres.
    """
    to_other = other_m - centre_m
    distance_m = abs(to_other)
    if not abs(radius_m - other_radius_m) < distance_m < radius_m + other_radius_m:
        return set()
    cosine = (radius_m**2 + distance_m**2 - other_radius_m**2) / (2.0 * radius_m * distance_m)
    half = cmath.rect(1.0, math.acos(max(-1.0, min(1.0, cosine))))
    return {cmath.phase(to_other * half), cmath.phase(to_other / half)}


def _circle_crossings(
    from_m: complex, to_m: complex, centre_m: complex, radius_m: float
) -> set[float]:
    """Return the shares of a line at which it crosses a circle.

    With d = to - from and f = from - centre, |f + s d| = r is
    |d|^2 s^2 + 2 Re(f d*) s + |f|^2 - r^2 = 0.
    """
    d, f = to_m - from_m, from_m - centre_m
    a, b = abs(d) ** 2, (f * d.conjugate()).real
    discriminant = b * b - a * (abs(f) ** 2 - radius_m**2)
    if a == 0.0 or discriminant <= 0.0:
        return set()
    root = math.sqrt(discriminant)
    return {share for share in ((-b - root) / a, (-b + root) / a) if 0.0 < share < 1.0}


def _polygon_crossings(from_m: complex, to_m: complex, corners_m: Sequence[complex]) -> set[float]:
    """Return the shares of a line at which it crosses the edges of a polygon.

    With d = to - from, e = b - a and the cross product x, from + s d = a + t e gives
    s = (a - from) x e / (d x e) and t = (a - from) x d / (d x e).
    """
    d, shares = to_m - from_m, set()
    for a, b in zip(corners_m, (*corners_m[1:], corners_m[0]), strict=True):
        e = b - a
        determinant = (d.conjugate() * e).imag
        if determinant == 0.0:
            continue
        offset = a - from_m
        share = (offset.conjugate() * e).imag / determinant
        if 0.0 < share < 1.0 and 0.0 <= (offset.conjugate() * d).imag / determinant <= 1.0:
            shares.add(share)
    return shares


def inside_polygon(point_m: complex, corners_m: Sequence[complex]) -> bool:
    """Return whether a point is inside a polygon, which may be concave.

    Even-odd rule (Shimrat 1962, Algorithm 112): the number of edges that a ray to the north
    crosses.

    Parameters
    ----------
    point_m : complex
        Point, north + i east (m).
    corners_m : sequence of complex
        Corners in order.
    """
    inside = False
    for a, b in zip(corners_m, (*corners_m[1:], corners_m[0]), strict=True):
        if (a.imag > point_m.imag) == (b.imag > point_m.imag):
            continue
        share = (point_m.imag - a.imag) / (b.imag - a.imag)
        inside ^= point_m.real < a.real + share * (b.real - a.real)
    return inside


def nearest_rally(
    rally: Rally, fence: Fence, position_m: complex, home_deg: tuple[float, float]
) -> complex:
    """Return where RTL ends: the nearest rally point that the fence allows; home without one.

    Parameters
    ----------
    rally : Rally
        Rally points.
    fence : Fence
        Geofence.
    position_m : complex
        Position of the vehicle, north + i east from home (m).
    home_deg : tuple of 2 floats
        Latitude and longitude of home.

    Returns
    -------
    complex
        Position, north + i east from home (m).
    """
    points = [place.offset_m(*home_deg) for place in rally.places]
    allowed = [point for point in points if not breach(fence, point, home_deg)]
    return min(allowed, key=lambda point: abs(point - position_m), default=0j)
