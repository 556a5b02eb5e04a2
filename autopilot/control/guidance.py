"""Line-of-sight guidance along a line or a circle over ground, and positions of items. Pure.

Positions are complex numbers, north + i east from home (m); angles in rad, clockwise from north.
With y the cross-track error (m, positive to starboard of a line or outside a circle), D the
look-ahead distance (m), a = NAV_LOS_I (m/s) and I the integral::

    course   = azimuth - atan((y + a I) / D)        I' = D y / (D^2 + (y + a I)^2)
    heading  = course - asin(c_across / U) - arg(1 + m)

The course is proportional line of sight (Fossen 2021, "Handbook of Marine Craft Hydrodynamics and
Motion Control", section 12.4) with the integral of Børhaug, Pavlov and Pettersen (2008, eq. 12)
against constant disturbances. The heading is the course minus the crab angle of the estimated
current c and sideslip (Fossen 2021, section 12.5); U is the speed through the water, m its relative
error (``navigation``). On a circle the azimuth is that of the tangent and the offset turns inwards.
"""

import cmath
import math
from typing import NamedTuple

from autopilot.control import fence, modes
from autopilot.control.params import Config
from autopilot.control.setpoints import Circle, Path, Setpoint, TrackLine
from autopilot.control.types import US_PER_S, AutopilotState, Home, Motion, VehicleEstimate
from mavlink_io.frames import geodetic_to_offset, wrap_pi
from mavlink_io.jit import numeric
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    NOT_GIVEN,
    MissionItem,
)

MIN_WATER_SPEED_MPS = 0.3
"""Minimum speed assumed when the crab angle is computed."""
MAX_CRAB_SINE = math.sin(math.radians(60.0))
"""Sine of the maximum crab angle."""
INTEGRATION_ZONE = 1.0 / 3.0
"""Maximum cross-track error over the look-ahead distance at which the integral runs: a larger error
is transient."""
ZERO_ZERO_M = 100_000.0
"""Maximum distance of home from latitude and longitude 0 at which (0, 0) is a position.

geodetic_to_offset assumes a flat earth up to that distance. Farther away (0, 0) means the vehicle's
position, as in ArduPilot.
"""
_PROPULSIVE_MODES = frozenset(
    mode.number for mode in (modes.MISSION, modes.DEPTH, modes.STATION, modes.RTL)
)
"""Modes that start at cruise thrust."""


class PathProgress(NamedTuple):
    """Position of the vehicle relative to its path, for telemetry."""

    to_go_m: float
    """Distance to the end of a line, or to the centre of a circle."""
    bearing_rad: float
    """Bearing of the end of a line, or of the centre of a circle."""
    cross_m: float
    """Cross-track error, positive to starboard of a line or outside a circle."""


@numeric
def position_of(estimate: VehicleEstimate | Motion) -> complex:
    """Return the estimated position, north + i east from home (m)."""
    return complex(estimate.north_m, estimate.east_m)


def near_zero_zero(home: Home) -> bool:
    """Return whether latitude and longitude 0 are a position for this home (ZERO_ZERO_M)."""
    return (
        home.known
        and abs(complex(*geodetic_to_offset(0.0, 0.0, home.lat_deg, home.lon_deg))) <= ZERO_ZERO_M
    )


def item_position(item: MissionItem, home: Home) -> complex | None:
    """Return the position of an item, north + i east from home (m).

    None means the vehicle's position: the item has no position, or latitude and longitude 0 far
    from there.
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
    """Return the depth (m) of an item with a position; ``depth_m`` if it has none."""
    if math.isnan(item.z):
        return depth_m
    return item.z if item.frame == FRAME_LOCAL_NED else -item.z


def hold_current(state: AutopilotState, config: Config) -> AutopilotState:
    """Return the state with the set-points and the path of a mode that was just entered.

    Depth and heading are the present ones. A mode that moves the vehicle starts at cruise thrust.
    A mission that was interrupted resumes with its own set-points.
    """
    estimate, paused_setpoint, mode = state.estimate, state.mission.paused_setpoint, state.mode
    if mode == modes.MISSION.number and paused_setpoint is not None:
        return state._replace(
            setpoint=paused_setpoint, mission=state.mission._replace(paused_setpoint=None)
        )
    thrust = config.cruise_thrust_pct / 100.0 if mode in _PROPULSIVE_MODES else state.thrust
    setpoint, path = Setpoint(max(0.0, estimate.depth_m), estimate.heading_rad, thrust), state.path
    if mode == modes.STATION.number:
        path = circle(position_of(estimate), 0.0, config)
    if mode == modes.RTL.number:
        setpoint, path = (
            setpoint._replace(depth_m=config.rtl_depth_m),
            TrackLine(position_of(estimate), return_point(state)),
        )
    return state._replace(setpoint=setpoint, path=path)


def return_point(state: AutopilotState) -> complex:
    """Return where RTL ends, north + i east from home (m): a rally point, or home."""
    if not (state.rally.places and state.home.known):
        return 0j
    home = state.home.lat_deg, state.home.lon_deg
    return fence.nearest_rally(state.rally, state.fence, position_of(state.estimate), home)


def circle(
    centre_m: complex, radius_m: float, config: Config, since_us: int | None = None
) -> Circle:
    """Return a circle about a centre.

    A negative radius is counter-clockwise; 0 or NaN is clockwise with STN_RADIUS_M.
    """
    signed_m = radius_m if radius_m and math.isfinite(radius_m) else config.station_radius_m
    return Circle(centre_m, abs(signed_m), clockwise=signed_m > 0.0, since_us=since_us)


def follow(
    path: Path, estimate: VehicleEstimate, config: Config, time_us: int, dt_s: float
) -> tuple[Path, float]:
    """Return the path with its new integral, and the heading (rad) that follows it."""
    if isinstance(path, TrackLine):
        return follow_line(path, estimate, config, dt_s)
    path = _count_orbit(path, position_of(estimate) - path.centre_m, config, time_us)
    sense = 1.0 if path.clockwise else -1.0
    distance_m, bearing = cmath.polar(position_of(estimate) - path.centre_m)
    lookahead_m = min(config.lookahead_m, path.radius_m)
    offset, integral = _line_of_sight(
        distance_m - path.radius_m, path.integral, lookahead_m, config, dt_s
    )
    return path._replace(integral=integral), crab_heading(
        bearing + sense * (0.5 * math.pi + offset), estimate
    )


@numeric
def follow_line(
    path: TrackLine, estimate: VehicleEstimate, config: Config, dt_s: float
) -> tuple[TrackLine, float]:
    """Return a line with its new integral, and the heading (rad) that follows it."""
    cross_m, azimuth, _, _ = along_track_m(path, position_of(estimate))
    offset, integral = _line_of_sight(cross_m, path.integral, config.lookahead_m, config, dt_s)
    return path._replace(integral=integral), crab_heading(azimuth - offset, estimate)


@numeric
def _line_of_sight(
    cross_m: float, integral: float, lookahead_m: float, config: Config, dt_s: float
) -> tuple[float, float]:
    """Return the course offset (rad) towards the path, and the new integral.

    The integral runs only near the path: a vehicle far from it is still approaching.
    """
    error_m = cross_m + config.los_integral_mps * integral
    if abs(cross_m) < INTEGRATION_ZONE * lookahead_m:
        integral += dt_s * lookahead_m * cross_m / (lookahead_m * lookahead_m + error_m * error_m)
    return math.atan(error_m / lookahead_m), integral


def _count_orbit(path: Circle, radius_vector_m: complex, config: Config, time_us: int) -> Circle:
    """Add the angle swept since the circle was reached."""
    distance_m, bearing = cmath.polar(radius_vector_m)
    if path.since_us is None:
        on_circle = abs(distance_m - path.radius_m) < config.acceptance_m
        return path._replace(since_us=time_us if on_circle else None, bearing_rad=bearing)
    swept = wrap_pi(bearing - path.bearing_rad) * (1.0 if path.clockwise else -1.0)
    return path._replace(swept_rad=path.swept_rad + swept, bearing_rad=bearing)


@numeric
def along_track_m(path: TrackLine, position_m: complex) -> tuple[float, float, float, float]:
    """Return cross-track error (m, to starboard), azimuth (rad), distance along and length (m)."""
    line_m = path.to_m - path.from_m
    length_m, azimuth = cmath.polar(line_m)
    offset_m = (position_m - path.from_m) * cmath.rect(1.0, -azimuth)
    return offset_m.imag, azimuth, offset_m.real, length_m


@numeric
def crab_heading(course_rad: float, estimate: VehicleEstimate) -> float:
    """Return the heading (rad) that gives the course over ground in the estimated current."""
    navigation = estimate.navigation
    speed = max(MIN_WATER_SPEED_MPS, estimate.speed_mps * abs(1.0 + navigation.speed_error))
    across = (navigation.current_mps * cmath.rect(1.0, -course_rad)).imag / speed
    crab = math.asin(max(-MAX_CRAB_SINE, min(MAX_CRAB_SINE, across)))
    return wrap_pi(course_rad - crab - cmath.phase(1.0 + navigation.speed_error))


def update_heading(state: AutopilotState, config: Config, dt_s: float) -> AutopilotState:
    """Set the heading set-point by the path; unchanged without a path."""
    if state.path is None:
        return state
    path, heading_rad = follow(state.path, state.estimate, config, state.time_us, dt_s)
    return state._replace(path=path, setpoint=state.setpoint._replace(heading_rad=heading_rad))


@numeric
def reached(path: TrackLine, estimate: VehicleEstimate, acceptance_m: float) -> bool:
    """Return whether the vehicle is near the end of a line or has passed abeam of it."""
    position = position_of(estimate)
    if abs(path.to_m - position) <= acceptance_m:
        return True
    _, _, along_m, length_m = along_track_m(path, position)
    return along_m >= length_m


def orbit_time_s(path: Circle, time_us: int) -> float:
    """Return the time (s) since the circle was reached; 0 before."""
    return 0.0 if path.since_us is None else (time_us - path.since_us) / US_PER_S


def progress(path: Path, estimate: VehicleEstimate | Motion) -> PathProgress:
    """Return distance, bearing and cross-track error for telemetry."""
    position = position_of(estimate)
    if isinstance(path, TrackLine):
        to_go_m, bearing = cmath.polar(path.to_m - position)
        return PathProgress(to_go_m, bearing, along_track_m(path, position)[0])
    to_go_m, bearing = cmath.polar(path.centre_m - position)
    return PathProgress(to_go_m, bearing, to_go_m - path.radius_m)
