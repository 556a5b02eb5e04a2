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
WAYPOINT, LOITER_UNLIM, LOITER_TURNS, LOITER_TIME, LAND, DELAY = 16, 17, 18, 19, 21, 93
YAW, JUMP, SPEED, ALTITUDE = 115, 177, 178, 186
UNSUPPORTED_FRAME, UNSUPPORTED, PARAM1 = 2, 3, 6
PARAM2, PARAM3, PARAM4 = PARAM1 + 1, PARAM1 + 2, PARAM1 + 3
PARAM5, PARAM6, PARAM7 = PARAM1 + 4, PARAM1 + 5, PARAM1 + 6
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
    """Return a mission that can be flown: south of the excluded zone and within the fence.

    Only a short one is repeated once: 24 lines of 4 km would need more than the battery. An endless
    repetition ends by the battery failsafe.
    """
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
            amount = {
                LOITER_TURNS: rng.randint(1, 3),
                LOITER_TIME: rng.uniform(0.0, 200.0),
                WAYPOINT: rng.choice((0.0, 30.0)),
            }
            radius_m = 0.0 if kind == WAYPOINT else rng.choice((0.0, -30.0, rng.uniform(6, 45)))
            item = _place_item(kind, place_m, depth_m, amount[kind])
            items.append(item._replace(p3=radius_m))
    if len(items) <= 8 and rng.random() < 0.3:
        items.append(MissionItem(0, 2, JUMP, p1=rng.randrange(len(items)), p2=rng.randint(0, 1)))
    elif rng.random() < 0.3:
        items.append(MissionItem(0, 2, DELAY, p1=rng.uniform(1.0, 100.0), p2=-1, p3=-1, p4=-1))
        items.append(MissionItem(0, 2, JUMP, p1=rng.randrange(len(items)), p2=-1.0))
    return _numbered(items)


def impossible(rng: random.Random) -> Impossible:
    """Return a mission with one item that cannot be flown."""
    items = [item for item in feasible(rng) if item.command != JUMP]
    at = rng.randint(0, len(items))
    inside_m = complex(rng.uniform(-1900.0, 500.0), rng.uniform(-1900.0, 1900.0))
    good = _place_item(WAYPOINT, inside_m, rng.uniform(0.0, MAX_DEPTH_M))
    kind = rng.choice(sorted((*_FAULTS, *_REPETITIONS)))
    if kind in _REPETITIONS:
        bad, wrong, results = _REPETITIONS[kind](rng, good, at)
    else:
        bad, results = _FAULTS[kind](rng, good)
        wrong = len(bad) - 1
    return Impossible(_numbered([*items[:at], *bad, *items[at:]]), at + wrong, results, kind)


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
    return [good._replace(frame=rng.choice((4, 7, 8, 9, 10, 11, 12, 18, 20, 21)))], (
        UNSUPPORTED_FRAME,
    )


def _missing(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [MissionItem(0, 2, rng.choice((DELAY, YAW)), p1=math.nan)], (PARAM1,)


def _too_fast(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    """Return a speed beyond that of full thrust, 1.3 m/s at 58 %."""
    speed_mps = rng.uniform(2.3, 60.0)
    return [MissionItem(0, 2, SPEED, p1=rng.choice((0, 1)), p2=speed_mps, p3=-1)], (PARAM2,)


def _thrust(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    thrust_pct = rng.choice((rng.uniform(100.1, 900.0), rng.uniform(-900.0, -3.0)))
    return [MissionItem(0, 2, SPEED, p1=0, p2=-1, p3=thrust_pct)], (PARAM3,)


def _circle_over_island(
    rng: random.Random, good: MissionItem
) -> tuple[list[MissionItem], tuple[int, ...]]:
    """Return a circle outside the excluded zone that crosses its edge."""
    distance_m, over_m = rng.uniform(130.0, 220.0), rng.uniform(5.0, 60.0)
    radius_m = rng.choice((-1, 1)) * (distance_m - ISLAND_RADIUS_M + over_m)
    place = _place_item(LOITER_TIME, ISLAND_M - distance_m, 3.0, 60.0)
    return [_place_item(WAYPOINT, 0j, 3.0), place._replace(p3=radius_m)], (PARAM3,)


def _circle_over_edge(
    rng: random.Random, good: MissionItem
) -> tuple[list[MissionItem], tuple[int, ...]]:
    """Return a circle about a place inside the fence that leaves it."""
    gap_m = rng.uniform(5.0, 80.0)
    place = _place_item(LOITER_TURNS, complex(gap_m - FENCE_M, 0.0), 3.0, 1.0)
    radius_m = gap_m + rng.uniform(2.0, 300.0)
    return [_place_item(WAYPOINT, -1000 + 0j, 3.0), place._replace(p3=radius_m)], (PARAM3,)


def _hold_near_edge(
    rng: random.Random, good: MissionItem
) -> tuple[list[MissionItem], tuple[int, ...]]:
    """Return a waypoint with a hold time whose circle of STN_RADIUS_M leaves the fence."""
    place_m = complex(-1000.0, FENCE_M - rng.uniform(1.0, 18.0))
    return (
        [_place_item(WAYPOINT, -1000 + 0j, 3.0), _place_item(WAYPOINT, place_m, 3.0, 30.0)],
        (PARAM5, PARAM6),
    )


def _wide(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    radius_m = rng.uniform(12e3, 1e6)
    return [good._replace(command=LOITER_TIME, p1=5.0, p3=radius_m)], (PARAM3,)


def _negative(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    amount = -rng.uniform(0.5, 500.0)
    if (kind := rng.choice((DELAY, WAYPOINT, LOITER_TIME, LOITER_TURNS))) == DELAY:
        return [MissionItem(0, 2, DELAY, p1=amount)], (PARAM1,)
    return [good._replace(command=kind, p1=amount)], (PARAM1,)


def _turn(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    good = MissionItem(0, 2, YAW, p1=90.0)
    return rng.choice(
        (
            ([good._replace(p1=400.0)], (PARAM1,)),
            ([good._replace(p3=2.0)], (PARAM3,)),
            ([good._replace(p4=3.0)], (PARAM4,)),
        )
    )


def _tight(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    """Return a circle below the turning circle of 6 m."""
    radius_m = rng.choice((-1, 1)) * rng.choice((1.0, rng.uniform(1e-3, 5.9)))
    kind = rng.choice((LOITER_UNLIM, LOITER_TURNS, LOITER_TIME))
    return [good._replace(command=kind, p1=1.0, p3=radius_m)], (PARAM3,)


def _infinite(rng: random.Random, good: MissionItem) -> tuple[list[MissionItem], tuple[int, ...]]:
    value = rng.choice((-math.inf, math.inf))
    return rng.choice(
        (
            ([good._replace(p1=value)], (PARAM1,)),
            ([good._replace(p2=value)], (PARAM2,)),
            ([good._replace(p3=value)], (PARAM3,)),
            ([good._replace(p4=value)], (PARAM4,)),
            ([good._replace(z=value)], (PARAM7,)),
        )
    )


def _frame_of_change(
    rng: random.Random, good: MissionItem
) -> tuple[list[MissionItem], tuple[int, ...]]:
    return [MissionItem(0, 2, ALTITUDE, p1=-3.0, p2=rng.choice((1, 4, 7, 10)))], (PARAM2,)


_Repetition = tuple[list[MissionItem], int, tuple[int, ...]]
"""Items, index of the wrong one, and right results."""


def _jump_to(index: int, count: float) -> MissionItem:
    return MissionItem(0, 2, JUMP, p1=index, p2=count)


def _too_often(rng: random.Random, good: MissionItem, at: int) -> _Repetition:
    """Return a stay that a jump repeats beyond the battery."""
    stay = good._replace(command=LOITER_TIME, p1=rng.uniform(60.0, 3600.0))
    count = rng.uniform(1.1, 1e4) * BATTERY_H * 3600.0 / stay.p1
    return [stay, _jump_to(at, math.ceil(count))], 0, (PARAM1,)


def _nested(rng: random.Random, good: MissionItem, at: int) -> _Repetition:
    """Return a stay of at least 50 minutes that two jumps repeat 60 times or more."""
    stay = good._replace(command=LOITER_TIME, p1=rng.uniform(3e3, 9e3))
    counts = rng.choice(((2.0, 1e6), (1e6, 2.0), (30.0, 30.0)))
    return [good, stay, *(_jump_to(at, count) for count in counts)], 1, (PARAM1,)


def _idle(rng: random.Random, good: MissionItem, at: int) -> _Repetition:
    """Return an endless jump, or nearly, to itself or over items that take no time."""
    items = [
        MissionItem(0, 2, YAW, p1=90.0),
        MissionItem(0, 2, ALTITUDE, p1=-3.0, p2=3.0),
        MissionItem(0, 2, SPEED, p1=0, p2=1.0, p3=-1),
    ][: rng.randint(0, 3)]
    return [*items, _jump_to(at, rng.choice((-1.0, rng.uniform(2e3, 1e9))))], len(items), (PARAM1,)


def _line_back(rng: random.Random, good: MissionItem, at: int) -> _Repetition:
    """Return a way round the excluded zone whose line back to its begin crosses the zone."""
    ways_m = 0j, ISLAND_M + rng.uniform(300.0, 900.0) * 1j, 2.0 * ISLAND_M
    places = [_place_item(WAYPOINT, place_m, 3.0) for place_m in ways_m]
    return [*places, _jump_to(at, rng.choice((-1.0, 1.0)))], 0, (PARAM5, PARAM6)


def _negative_count(rng: random.Random, good: MissionItem, at: int) -> _Repetition:
    count = rng.choice((-2.0, -0.5, rng.uniform(-1e6, -1.1)))
    return [good, _jump_to(at, count)], 1, (PARAM2,)


def _jump_without_number(rng: random.Random, good: MissionItem, at: int) -> _Repetition:
    jump, value = _jump_to(at, 1.0), rng.choice((math.nan, math.inf))
    if rng.random() < 0.5:
        return [good, jump._replace(p1=value)], 1, (PARAM1,)
    return [good, jump._replace(p2=value)], 1, (PARAM2,)


_REPETITIONS = {
    "repeated beyond the battery": _too_often,
    "nested repetitions": _nested,
    "repetition without time": _idle,
    "line back through an excluded zone": _line_back,
    "negative count": _negative_count,
    "jump without a number": _jump_without_number,
}
_FAULTS = {
    "circle below the turning circle": _tight,
    "infinite number": _infinite,
    "too fast": _too_fast,
    "thrust out of range": _thrust,
    "circle over an excluded zone": _circle_over_island,
    "circle over the fence": _circle_over_edge,
    "hold near the fence": _hold_near_edge,
    "circle beyond the distance": _wide,
    "negative time": _negative,
    "turn": _turn,
    "frame of a change of altitude": _frame_of_change,
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
