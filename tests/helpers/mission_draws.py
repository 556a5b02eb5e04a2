"""Random missions inside given limits, and the same with one item that cannot be flown."""

import math
import random
from typing import NamedTuple

from autopilot.control.types import Home
from mavlink_io.frames import offset_to_geodetic
from mavlink_io.mission_items import FENCE_TYPE, MissionItem

HOME = Home(42.35, -71.0, True)
FENCE_M, ISLAND_M, ISLAND_RADIUS_M = 2000.0, 700.0 + 0j, 100.0
"""Half the side of the square fence about home; centre and radius of a zone that is excluded."""
MAX_DEPTH_M, BATTERY_H, CRUISE_MPS = 15.0, 10.0, 1.3
WAYPOINT, LOITER_TURNS, LOITER_TIME, LAND, DELAY = 16, 18, 19, 21, 93
YAW, JUMP, SPEED, ALTITUDE, WAIT = 115, 177, 178, 186, 113
UNSUPPORTED_FRAME, UNSUPPORTED, INVALID, PARAM1 = 2, 3, 5, 6
PARAM2, PARAM5, PARAM6, PARAM7 = PARAM1 + 1, PARAM1 + 4, PARAM1 + 5, PARAM1 + 6
"""Values of MAV_MISSION_RESULT."""


class Impossible(NamedTuple):
    """A mission that must be refused."""

    items: tuple[MissionItem, ...]
    sequence: int
    """Item that the refusal must name."""
    results: tuple[int, ...]
    """MAV_MISSION_RESULT that are right."""
    reason: str
    """Kind of fault, for the message of a failed test."""


def fence() -> tuple[MissionItem, ...]:
    """Return the items of the geofence."""
    corners = [complex(n, e) * FENCE_M for n, e in ((1, -1), (1, 1), (-1, 1), (-1, -1))]
    square = tuple(_fence_item(n, 5001, 4.0, corner) for n, corner in enumerate(corners))
    return (*square, _fence_item(4, 5004, ISLAND_RADIUS_M, ISLAND_M))


def _fence_item(sequence: int, command: int, p1: float, place_m: complex) -> MissionItem:
    x, y = _degrees(place_m)
    return MissionItem(sequence, 3, command, p1=p1, x=x, y=y, mission_type=FENCE_TYPE)


def _degrees(place_m: complex) -> tuple[int, int]:
    lat, lon = offset_to_geodetic(place_m.real, place_m.imag, HOME.lat_deg, HOME.lon_deg)
    return round(lat * 1e7), round(lon * 1e7)


def _place_item(command: int, place_m: complex, depth_m: float, p1: float = 0.0) -> MissionItem:
    x, y = _degrees(place_m)
    return MissionItem(0, 6, command, p1=p1, x=x, y=y, z=-depth_m)


def _numbered(items: list[MissionItem]) -> tuple[MissionItem, ...]:
    return tuple(item._replace(sequence=n) for n, item in enumerate(items))


def feasible(rng: random.Random) -> tuple[MissionItem, ...]:
    """Return a mission that can be flown: south of the excluded zone and within the fence."""
    items: list[MissionItem] = []
    for _ in range(rng.randint(1, 12)):
        place_m = complex(rng.uniform(-1900.0, 550.0), rng.uniform(-1900.0, 1900.0))
        depth_m = rng.uniform(0.0, MAX_DEPTH_M)
        kind = rng.choice((WAYPOINT, WAYPOINT, WAYPOINT, LOITER_TURNS, LOITER_TIME, SPEED, YAW))
        if kind == SPEED:
            items.append(MissionItem(0, 2, SPEED, p1=0.0, p2=rng.uniform(0.8, 1.3), p3=-1.0))
        elif kind == YAW:
            items += [
                MissionItem(0, 2, ALTITUDE, p1=-depth_m, p2=3.0),
                MissionItem(0, 2, YAW, p1=rng.uniform(0.0, 360.0)),
                MissionItem(0, 2, DELAY, p1=rng.uniform(0.0, 300.0), p2=-1, p3=-1, p4=-1),
            ]
        else:
            amount = {LOITER_TURNS: rng.randint(1, 3), LOITER_TIME: rng.uniform(0.0, 200.0)}
            items.append(_place_item(kind, place_m, depth_m, amount.get(kind, 0.0)))
    if rng.random() < 0.3:
        items.append(MissionItem(0, 2, JUMP, p1=rng.randrange(len(items)), p2=rng.randint(0, 1)))
    return _numbered(items)


def impossible(rng: random.Random) -> Impossible:
    """Return a mission with one item that cannot be flown."""
    items = [item for item in feasible(rng) if item.command != JUMP]
    at = rng.randint(0, len(items))
    inside_m = complex(rng.uniform(-1900.0, 500.0), rng.uniform(-1900.0, 1900.0))
    good = _place_item(WAYPOINT, inside_m, rng.uniform(0.0, MAX_DEPTH_M))
    kind = rng.choice(sorted(_FAULTS))
    bad, results = _FAULTS[kind](rng, good)
    return Impossible(_numbered([*items[:at], *bad, *items[at:]]), at + len(bad) - 1, results, kind)


def _too_deep(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [good._replace(z=-rng.uniform(18.1, 500.0))], (PARAM7,)


def _above(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [good._replace(z=rng.uniform(0.1, 50.0))], (PARAM7,)


def _deep_change(
    rng: random.Random, good: MissionItem
) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [MissionItem(0, 2, ALTITUDE, p1=-rng.uniform(18.1, 500.0))], (PARAM1,)


def _outside(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    angle, radius_m = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(2.9e3, 9e3)
    place_m = radius_m * complex(math.cos(angle), math.sin(angle))
    return [_place_item(WAYPOINT, place_m, 3.0)], (PARAM5, PARAM6)


def _far(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [_place_item(WAYPOINT, complex(rng.uniform(11e3, 80e3), 0.0), 3.0)], (PARAM5,)


def _line(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    """Return two places beside the excluded zone whose line crosses it."""
    north_m = ISLAND_M.real + rng.uniform(-0.8, 0.8) * ISLAND_RADIUS_M
    east_m = rng.uniform(150.0, 1500.0)
    return (
        [
            _place_item(WAYPOINT, complex(0.0, -east_m), 3.0),
            _place_item(WAYPOINT, complex(north_m, -east_m), 3.0),
            _place_item(WAYPOINT, complex(north_m, east_m), 3.0),
        ],
        (PARAM5, PARAM6),
    )


def _island(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    place_m = ISLAND_M + rng.uniform(-60.0, 60.0) * 1j
    return [_place_item(rng.choice((WAYPOINT, LOITER_TIME, LAND)), place_m, 3.0)], (PARAM5, PARAM6)


def _battery(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    seconds = rng.uniform(1.0, 3.0) * BATTERY_H * 3600.0
    return [good._replace(command=LOITER_TIME, p1=seconds)], (PARAM1,)


def _turns(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    """Return more turns of 20 m radius than a full battery lasts."""
    full = BATTERY_H * 3600.0 * CRUISE_MPS / (2.0 * math.pi * 20.0)
    return [good._replace(command=LOITER_TURNS, p1=rng.uniform(1.0, 4.0) * full)], (PARAM1,)


def _no_thrust(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    south = _place_item(WAYPOINT, -1500.0 + 0j, 3.0)
    return [south, MissionItem(0, 2, SPEED, p2=-1.0, p3=0.0), good], (PARAM5, PARAM6)


def _latitude(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [good._replace(x=round(rng.uniform(90.1, 200.0) * 1e7))], (PARAM5,)


def _longitude(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [good._replace(y=round(rng.uniform(180.1, 213.0) * 1e7))], (PARAM6,)


def _jump(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [MissionItem(0, 2, JUMP, p1=rng.randint(100, 500), p2=1.0)], (PARAM1,)


def _command(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [MissionItem(0, 3, rng.choice((22, 82, 183, 206, 84)))], (UNSUPPORTED,)


def _frame(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [good._replace(frame=rng.choice((4, 7, 8, 10, 11)))], (UNSUPPORTED_FRAME,)


def _missing(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [MissionItem(0, 2, rng.choice((DELAY, YAW)), p1=math.nan)], (PARAM1,)


_FAULTS = {
    "too deep": _too_deep,
    "above the water": _above,
    "too deep change of altitude": _deep_change,
    "outside the fence": _outside,
    "far from home": _far,
    "line through an excluded zone": _line,
    "in an excluded zone": _island,
    "time beyond the battery": _battery,
    "turns beyond the battery": _turns,
    "place without thrust": _no_thrust,
    "latitude": _latitude,
    "longitude": _longitude,
    "jump to no item": _jump,
    "unknown command": _command,
    "frame": _frame,
    "missing number": _missing,
}
