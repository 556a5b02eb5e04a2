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
from autopilot.control.setpoints import Circle, Path, Setpoint, TrackLine
from autopilot.control.types import US_PER_S, AutopilotState, Home, VehicleEstimate
from mavlink_io.frames import geodetic_to_offset, wrap_pi
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    NOT_GIVEN,
    MissionItem,
)

MIN_WATER_SPEED_MPS = 0.3
"""A crab angle is reckoned with at least this speed."""
MAX_CRAB_SINE = math.sin(math.radians(60.0))
INTEGRATION_ZONE = 1.0 / 3.0
"""Of the look-ahead distance: what is further off has causes that pass."""
ZERO_ZERO_M = 100_000.0
"""Latitude and longitude 0 are a place only where home is this near to it: as far as
geodetic_to_offset may take the earth for flat. Elsewhere they mean "here", as for ArduPilot."""
_PROPULSIVE_MODES = frozenset(
    mode.number for mode in (modes.MISSION, modes.DEPTH, modes.STATION, modes.RTL)
)


class PathProgress(NamedTuple):
    """Where she is on a path, as ground is told."""

    to_go_m: float
    """To the end of a line, to the centre of a circle."""
    bearing_rad: float
    """Of that place."""
    cross_m: float
    """To starboard of a line, outside a circle."""


def position_of(estimate: VehicleEstimate) -> complex:
    return complex(estimate.north_m, estimate.east_m)


def near_zero_zero(home: Home) -> bool:
    """Whether latitude and longitude 0 are a place to a vehicle of this home."""
    return (
        home.known
        and abs(complex(*geodetic_to_offset(0.0, 0.0, home.lat_deg, home.lon_deg))) <= ZERO_ZERO_M
    )


def item_position(item: MissionItem, home: Home) -> complex | None:
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


def item_depth_m(item: MissionItem, depth_m: float) -> float:
    """The depth that an item with a place gives, ``depth_m`` where it gives none."""
    if math.isnan(item.z):
        return depth_m
    return item.z if item.frame == FRAME_LOCAL_NED else -item.z


def hold_current(state: AutopilotState, config: Config) -> AutopilotState:
    """What entering a mode puts in force: this depth and heading, at cruise thrust where the mode
    goes somewhere.

    A mission that was left on the way goes on with its own set-points.
    """
    at, paused_setpoint, mode = state.estimate, state.mission.paused_setpoint, state.mode
    if mode == modes.MISSION.number and paused_setpoint is not None:
        return state._replace(
            setpoint=paused_setpoint, mission=state.mission._replace(paused_setpoint=None)
        )
    thrust = config.cruise_thrust_pct / 100.0 if mode in _PROPULSIVE_MODES else state.thrust
    setpoint, path = Setpoint(max(0.0, at.depth_m), at.heading_rad, thrust), state.path
    if mode == modes.STATION.number:
        path = circle(position_of(at), 0.0, config)
    if mode == modes.RTL.number:
        setpoint, path = (
            setpoint._replace(depth_m=config.rtl_depth_m),
            TrackLine(position_of(at), 0j),
        )
    return state._replace(setpoint=setpoint, path=path)


def circle(
    centre_m: complex, radius_m: float, config: Config, since_us: int | None = None
) -> Circle:
    """Round a place; a negative radius is counter-clockwise, none or NaN is that of
    STN_RADIUS_M."""
    given = radius_m if radius_m and math.isfinite(radius_m) else config.station_radius_m
    return Circle(centre_m, abs(given), clockwise=given > 0.0, since_us=since_us)


def follow(
    path: Path, estimate: VehicleEstimate, config: Config, time_us: int, dt_s: float
) -> tuple[Path, float]:
    """The path with its memory, and the heading that keeps her on it."""
    if isinstance(path, TrackLine):
        cross_m, azimuth, _, _ = along_track_m(path, position_of(estimate))
        aside, integral = _line_of_sight(cross_m, path.integral, config.lookahead_m, config, dt_s)
        return path._replace(integral=integral), crab_heading(azimuth - aside, estimate)
    path = _count_orbit(path, position_of(estimate) - path.centre_m, config, time_us)
    sense = 1.0 if path.clockwise else -1.0
    distance_m, bearing = cmath.polar(position_of(estimate) - path.centre_m)
    ahead_m = min(config.lookahead_m, path.radius_m)
    aside, integral = _line_of_sight(
        distance_m - path.radius_m, path.integral, ahead_m, config, dt_s
    )
    return path._replace(integral=integral), crab_heading(
        bearing + sense * (0.5 * math.pi + aside), estimate
    )


def _line_of_sight(
    cross_m: float, integral: float, ahead_m: float, config: Config, dt_s: float
) -> tuple[float, float]:
    """The angle back to the path, and the integral of it, which waits while she is still on her way
    there."""
    aside_m = cross_m + config.los_integral_mps * integral
    if abs(cross_m) < INTEGRATION_ZONE * ahead_m:
        integral += dt_s * ahead_m * cross_m / (ahead_m**2 + aside_m**2)
    return math.atan(aside_m / ahead_m), integral


def _count_orbit(path: Circle, off_m: complex, config: Config, time_us: int) -> Circle:
    """Count the way round from when the rim was reached."""
    distance_m, bearing = cmath.polar(off_m)
    if path.since_us is None:
        arrived = abs(distance_m - path.radius_m) < config.acceptance_m
        return path._replace(since_us=time_us if arrived else None, bearing_rad=bearing)
    turned = wrap_pi(bearing - path.bearing_rad) * (1.0 if path.clockwise else -1.0)
    return path._replace(swept_rad=path.swept_rad + turned, bearing_rad=bearing)


def along_track_m(path: TrackLine, position_m: complex) -> tuple[float, float, float, float]:
    """Cross-track error (m, to starboard), azimuth (rad), way along the line and its length (m)."""
    distance_m = path.to_m - path.from_m
    length_m, azimuth = cmath.polar(distance_m)
    off_m = (position_m - path.from_m) * cmath.rect(1.0, -azimuth)
    return off_m.imag, azimuth, off_m.real, length_m


def crab_heading(course_rad: float, estimate: VehicleEstimate) -> float:
    """The heading that makes the course good in the estimated current."""
    learned = estimate.navigation
    water = max(MIN_WATER_SPEED_MPS, estimate.speed_mps * abs(1.0 + learned.speed_error))
    across = (learned.current_mps * cmath.rect(1.0, -course_rad)).imag / water
    crab = math.asin(max(-MAX_CRAB_SINE, min(MAX_CRAB_SINE, across)))
    return wrap_pi(course_rad - crab - cmath.phase(1.0 + learned.speed_error))


def update_heading(state: AutopilotState, config: Config, dt_s: float) -> AutopilotState:
    """Point the heading along the path, where there is one."""
    if state.path is None:
        return state
    path, heading_rad = follow(state.path, state.estimate, config, state.time_us, dt_s)
    return state._replace(path=path, setpoint=state.setpoint._replace(heading_rad=heading_rad))


def reached(path: TrackLine, estimate: VehicleEstimate, acceptance_m: float) -> bool:
    """Whether she is near the end of a line, or has passed abeam of it."""
    place = position_of(estimate)
    if abs(path.to_m - place) <= acceptance_m:
        return True
    _, _, distance_m, length_m = along_track_m(path, place)
    return distance_m >= length_m


def orbit_time_s(path: Circle, time_us: int) -> float:
    """Seconds on the circle."""
    return 0.0 if path.since_us is None else (time_us - path.since_us) / US_PER_S


def progress(path: Path, estimate: VehicleEstimate) -> PathProgress:
    """How far she has come."""
    place = position_of(estimate)
    if isinstance(path, TrackLine):
        to_go_m, bearing = cmath.polar(path.to_m - place)
        return PathProgress(to_go_m, bearing, along_track_m(path, place)[0])
    to_go_m, bearing = cmath.polar(path.centre_m - place)
    return PathProgress(to_go_m, bearing, to_go_m - path.radius_m)
