"""Waypoints and geofence on the map of the live page, in metres north and east."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.frames import geodetic_to_offset, offset_to_geodetic
from mavlink_io.mission_items import (
    FENCE_TYPE,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    MISSION_TYPE,
    NOT_GIVEN,
    MavCmd,
    MissionItem,
)
from mavlink_io.request import Exchange, ExchangeError, MavlinkId, Send
from mavlink_io.services.missions import MissionClient

READ_PERIOD_S = 60.0
"""Wall time after which the plans are read again, as MAVLink does not report every change."""
_WAYPOINTS = frozenset(
    (
        MavCmd.NAV_WAYPOINT,
        MavCmd.NAV_LOITER_UNLIM,
        MavCmd.NAV_LOITER_TURNS,
        MavCmd.NAV_LOITER_TIME,
    )
)
_POLYGONS = {
    MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {MavCmd.NAV_FENCE_CIRCLE_INCLUSION: True, MavCmd.NAV_FENCE_CIRCLE_EXCLUSION: False}


class Origin(NamedTuple):
    """Latitude and longitude of the zero of the local frame (deg)."""

    lat_deg: float
    lon_deg: float

    def local_m(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Return metres north and east of the origin."""
        return geodetic_to_offset(lat_deg, lon_deg, *self)

    def moved(self, north_m: float, east_m: float) -> "Origin":
        """Return the place that lies this far north and east."""
        return Origin(*offset_to_geodetic(north_m, east_m, *self))


class Waypoint(msgspec.Struct, frozen=True):
    """A waypoint on the map (m)."""

    sequence: int
    north_m: float
    east_m: float


class DrawnZone(msgspec.Struct, frozen=True):
    """A zone of the fence: a polygon, or a circle about its only point (m)."""

    inclusion: bool
    points: list[tuple[float, float]]
    radius_m: float = 0.0


class DrawnPlan(msgspec.Struct, frozen=True):
    """What the map shows of the plans on the vehicle."""

    waypoints: list[Waypoint]
    zones: list[DrawnZone]


def draw(items: Iterable[MissionItem], origin: Origin | None) -> DrawnPlan:
    """Return the waypoints and zones of mission and fence; items without a place are left out.

    Parameters
    ----------
    items : iterable of MissionItem
        Items of the mission and of the fence.
    origin : Origin, optional
        Zero of the local frame; without it items with latitude and longitude have no place.

    Returns
    -------
    DrawnPlan
        Waypoints and zones in metres.
    """
    waypoints, zones = list[Waypoint](), list[DrawnZone]()
    vertices, inclusion = list[tuple[float, float]](), True
    for item in items:
        place_m = _place_m(item, origin)
        if place_m is None:
            continue
        if item.command in _WAYPOINTS:
            waypoints.append(Waypoint(item.sequence, *place_m))
        elif item.command in _CIRCLES:
            zones.append(DrawnZone(_CIRCLES[MavCmd(item.command)], [place_m], item.p1))
        elif item.command in _POLYGONS:
            inclusion = _POLYGONS[MavCmd(item.command)]
            vertices.append(place_m)
            if len(vertices) >= item.p1:
                zones.append(DrawnZone(inclusion, vertices))
                vertices = []
    return DrawnPlan(waypoints, zones)


def _place_m(item: MissionItem, origin: Origin | None) -> tuple[float, float] | None:
    """Return the place of an item in metres north and east; None without one."""
    if NOT_GIVEN in (item.x, item.y):
        return None
    if item.frame in GLOBAL_FRAMES:
        is_zero = item.x == item.y == 0
        if origin is None or (is_zero and item.command in _WAYPOINTS):
            return None
        return origin.local_m(item.x / GLOBAL_SCALE, item.y / GLOBAL_SCALE)
    return item.x / LOCAL_SCALE, item.y / LOCAL_SCALE


class PlanReader:
    """Reads mission and fence of a vehicle, one after the other, and again after a change.

    Parameters
    ----------
    send : Send
        Sends a message to the vehicle.
    own, peer : MavlinkId
        Ids of this program and of the vehicle.
    """

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        self._client = MissionClient(send, own, peer)
        self._exchange: Exchange[tuple[MissionItem, ...]] | None = None
        self._waiting: list[int] = []
        self._items: dict[int, tuple[MissionItem, ...]] = {}
        self._due_s, self._total = -math.inf, -1

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """Items of the mission and of the fence that were read last."""
        return (*self._items.get(MISSION_TYPE, ()), *self._items.get(FENCE_TYPE, ()))

    def poll(self) -> None:
        """Send what is due."""
        if self._exchange is None and not self._waiting and wall_s() > self._due_s:
            self._waiting, self._due_s = [FENCE_TYPE, MISSION_TYPE], wall_s() + READ_PERIOD_S
        if self._exchange is None and self._waiting:
            self._exchange = self._client.download(self._waiting[-1])
        if self._exchange is not None:
            self._exchange.poll(wall_s())
            self._finish()

    def feed(self, frame: Frame) -> None:
        """Process a frame of the vehicle."""
        if frame.name == "MISSION_CURRENT":
            total = frame.decode().total
            if self._total not in (-1, total):
                self._due_s = -math.inf
            self._total = total
        if self._exchange is not None:
            self._exchange.feed(frame)
            self._finish()

    def _finish(self) -> None:
        """Store the items of a finished exchange; a vehicle that refuses has no such plan."""
        if self._exchange is None or not self._exchange.done:
            return
        try:
            self._items[self._waiting[-1]] = self._exchange.result()
        except ExchangeError:
            self._items.pop(self._waiting[-1], None)
        self._waiting.pop()
        self._exchange = None
