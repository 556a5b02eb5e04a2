"""From a line or a circle over ground to a heading: line of sight with a look-ahead distance. Pure.

Course: Fossen (2021), "Handbook of Marine Craft Hydrodynamics and Motion Control", section 12.4:
proportional line of sight, with the integral of Børhaug, Pavlov and Pettersen (2008, eq. 12) for
what steers her off for good. Heading: the course less the crab angle that the estimated current and
sideslip ask for (Fossen 2021, section 12.5). A circle is a line that bends: its cross-track error
is the distance from the rim. Places are complex numbers: north + i east from home."""

import cmath
import math
from typing import NamedTuple

from autopilot.control import modes
from autopilot.control.params import Config
from autopilot.control.setpoints import Circle, Line, Path, Setpoint
from autopilot.control.types import US_PER_S, Estimate, Home, State
from mavlink_io.frames import geodetic_to_offset, wrap_pi
from mavlink_io.services.missions import (
    FRAME_LOCAL_NED,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    NOT_GIVEN,
    MissionItem,
)

LEAST_WATER_MPS = 0.3
"""A crab angle is reckoned with at least this speed."""
MOST_CRAB = math.sin(math.radians(60.0))
INTEGRATES_WITHIN = 1.0 / 3.0
"""Of the look-ahead distance: what is further off has causes that pass."""
ZERO_ZERO_M = 100_000.0
"""Latitude and longitude 0 are a place only where home is this near to it: as far as
geodetic_to_offset may take the earth for flat. Elsewhere they mean "here", as for ArduPilot."""
_UNDER_WAY = frozenset(
    mode.number for mode in (modes.MISSION, modes.DEPTH, modes.STATION, modes.RTL)
)


class Progress(NamedTuple):
    """Where she is on a path, as ground is told."""

    to_go_m: float
    """To the end of a line, to the centre of a circle."""
    bearing_rad: float
    """Of that place."""
    cross_m: float
    """To starboard of a line, outside a circle."""


def here(estimate: Estimate) -> complex:
    return complex(estimate.north_m, estimate.east_m)


def near_zero_zero(home: Home) -> bool:
    """Whether latitude and longitude 0 are a place to a vehicle of this home."""
    return (
        home.known
        and abs(complex(*geodetic_to_offset(0.0, 0.0, home.lat_deg, home.lon_deg))) <= ZERO_ZERO_M
    )


def place_of(item: MissionItem, home: Home) -> complex | None:
    """The place that an item gives, north + i east of home (m).

    None means here: an item without a place, or zero latitude and longitude far from (0, 0).
    """
    if item.frame == FRAME_LOCAL_NED:
        return complex(item.x, item.y) / LOCAL_SCALE
    if item.frame not in GLOBAL_FRAMES or NOT_GIVEN in (item.x, item.y):
        return None
    if item.x == 0 and item.y == 0 and not near_zero_zero(home):
        return None
    lat, lon = item.x / GLOBAL_SCALE, item.y / GLOBAL_SCALE
    return complex(*geodetic_to_offset(lat, lon, home.lat_deg, home.lon_deg))


def depth_of(item: MissionItem, depth_m: float) -> float:
    """The depth that an item with a place gives, ``depth_m`` where it gives none."""
    if math.isnan(item.z):
        return depth_m
    return item.z if item.frame == FRAME_LOCAL_NED else -item.z


def take_up(state: State, config: Config) -> State:
    """What entering a mode puts in force: this depth and heading, at cruise thrust where the mode
    goes somewhere.

    A mission that was left on the way goes on with its own set-points.
    """
    at, paused, mode = state.estimate, state.mission.paused, state.mode
    if mode == modes.MISSION.number and paused is not None:
        return state._replace(setpoint=paused, mission=state.mission._replace(paused=None))
    thrust = config.cruise_thrust_pct / 100.0 if mode in _UNDER_WAY else state.thrust
    setpoint, path = Setpoint(max(0.0, at.depth_m), at.heading_rad, thrust), state.path
    if mode == modes.STATION.number:
        path = circle(here(at), 0.0, config)
    if mode == modes.RTL.number:
        setpoint, path = setpoint._replace(depth_m=config.rtl_depth_m), Line(here(at), 0j)
    return state._replace(setpoint=setpoint, path=path)


def circle(
    centre_m: complex, radius_m: float, config: Config, since_us: int | None = None
) -> Circle:
    """Round a place; a negative radius is counter-clockwise, none or NaN is that of
    STN_RADIUS_M."""
    given = radius_m if radius_m and math.isfinite(radius_m) else config.station_radius_m
    return Circle(centre_m, abs(given), clockwise=given > 0.0, since_us=since_us)


def follow(
    path: Path, estimate: Estimate, config: Config, time_us: int, dt_s: float
) -> tuple[Path, float]:
    """The path with its memory, and the heading that keeps her on it."""
    if isinstance(path, Line):
        cross_m, azimuth, _, _ = along(path, here(estimate))
        aside, integral = _sight(cross_m, path.integral, config.lookahead_m, config, dt_s)
        return path._replace(integral=integral), heading_for(azimuth - aside, estimate)
    path = _round(path, here(estimate) - path.centre_m, config, time_us)
    sense = 1.0 if path.clockwise else -1.0
    distance_m, bearing = cmath.polar(here(estimate) - path.centre_m)
    ahead_m = min(config.lookahead_m, path.radius_m)
    aside, integral = _sight(distance_m - path.radius_m, path.integral, ahead_m, config, dt_s)
    return path._replace(integral=integral), heading_for(
        bearing + sense * (0.5 * math.pi + aside), estimate
    )


def _sight(
    cross_m: float, integral: float, ahead_m: float, config: Config, dt_s: float
) -> tuple[float, float]:
    """The angle back to the path, and the integral of it, which waits while she is still on her way
    there."""
    aside_m = cross_m + config.los_integral_mps * integral
    if abs(cross_m) < INTEGRATES_WITHIN * ahead_m:
        integral += dt_s * ahead_m * cross_m / (ahead_m**2 + aside_m**2)
    return math.atan(aside_m / ahead_m), integral


def _round(path: Circle, off_m: complex, config: Config, time_us: int) -> Circle:
    """Count the way round from when the rim was reached."""
    distance_m, bearing = cmath.polar(off_m)
    if path.since_us is None:
        arrived = abs(distance_m - path.radius_m) < config.acceptance_m
        return path._replace(since_us=time_us if arrived else None, bearing_rad=bearing)
    turned = wrap_pi(bearing - path.bearing_rad) * (1.0 if path.clockwise else -1.0)
    return path._replace(turned_rad=path.turned_rad + turned, bearing_rad=bearing)


def along(path: Line, place_m: complex) -> tuple[float, float, float, float]:
    """Cross-track error (m, to starboard), azimuth (rad), way along the line and its length (m)."""
    way_m = path.to_m - path.from_m
    length_m, azimuth = cmath.polar(way_m)
    off_m = (place_m - path.from_m) * cmath.rect(1.0, -azimuth)
    return off_m.imag, azimuth, off_m.real, length_m


def heading_for(course_rad: float, estimate: Estimate) -> float:
    """The heading that makes the course good in the estimated current."""
    learned = estimate.navigation
    water = max(LEAST_WATER_MPS, estimate.speed_mps * abs(1.0 + learned.water_error))
    across = (learned.current_mps * cmath.rect(1.0, -course_rad)).imag / water
    crab = math.asin(max(-MOST_CRAB, min(MOST_CRAB, across)))
    return wrap_pi(course_rad - crab - cmath.phase(1.0 + learned.water_error))


def steer(state: State, config: Config, dt_s: float) -> State:
    """Point the heading along the path, where there is one."""
    if state.path is None:
        return state
    path, heading_rad = follow(state.path, state.estimate, config, state.time_us, dt_s)
    return state._replace(path=path, setpoint=state.setpoint._replace(heading_rad=heading_rad))


def reached(path: Line, estimate: Estimate, acceptance_m: float) -> bool:
    """Whether she is near the end of a line, or has passed abeam of it."""
    place = here(estimate)
    if abs(path.to_m - place) <= acceptance_m:
        return True
    _, _, way_m, length_m = along(path, place)
    return way_m >= length_m


def circled_s(path: Circle, time_us: int) -> float:
    """Seconds on the circle."""
    return 0.0 if path.since_us is None else (time_us - path.since_us) / US_PER_S


def progress(path: Path, estimate: Estimate) -> Progress:
    """How far she has come."""
    place = here(estimate)
    if isinstance(path, Line):
        to_go_m, bearing = cmath.polar(path.to_m - place)
        return Progress(to_go_m, bearing, along(path, place)[0])
    to_go_m, bearing = cmath.polar(path.centre_m - place)
    return Progress(to_go_m, bearing, to_go_m - path.radius_m)
