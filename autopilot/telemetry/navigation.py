"""Where she is and where she is going, as messages: how sure she is of it goes with it."""

import math

from autopilot.control import guidance
from autopilot.control import navigation as plot
from autopilot.control.failsafe import depth_unknown
from autopilot.control.setpoints import TrackLine
from autopilot.telemetry.encoding import boot_ms, int16, time_us, uint16
from autopilot.vehicle import Snapshot
from mavlink_io.dialect import Values, constant
from mavlink_io.frames import rotate_back

_GLOBAL_NED, _CHILD_FRD = constant("MAV_FRAME_LOCAL_NED"), constant("MAV_FRAME_BODY_FRD")
_ALL_BUT_DEPTH_AND_YAW = 0b1001_1111_1011
_PLACE = 0b11
"""POSITION_TARGET_TYPEMASK: what is ignored, and of that x and y."""
_DEPTH_SD_M, _TILT_SD_RAD, _HEADING_SD_RAD = 0.1, math.radians(0.5), math.radians(1.0)
"""Of depth and attitude, by the instruments' kind: nobody on board estimates them."""
_NO_RATIOS = (math.nan,) * 6
"""Innovations over their gates are not kept."""
_ALWAYS, _ABSOLUTE, _DEEP, _ABOVE_FLOOR, _GLITCH = (
    sum(constant(f"ESTIMATOR_{name}") for name in names)
    for names in (
        ("ATTITUDE", "VELOCITY_HORIZ", "VELOCITY_VERT", "POS_HORIZ_REL", "PRED_POS_HORIZ_REL"),
        ("POS_HORIZ_ABS", "PRED_POS_HORIZ_ABS"),
        ("POS_VERT_ABS",),
        ("POS_VERT_AGL",),
        ("GPS_GLITCH",),
    )
)


def navigation(s: Snapshot) -> Values:
    """Bearings of what is steered and of the target; without a path the target is where she points
    to."""
    wanted, path = s.state.setpoint, s.state.path
    ahead = target = int16(math.degrees(wanted.heading_rad))
    to_go_m = cross_m = 0.0
    if path is not None:
        to_go_m, bearing_rad, cross_m = guidance.progress(path, s.state.estimate)
        target = int16(math.degrees(bearing_rad))
    pitch_deg = math.degrees(s.trace.pitch_setpoint_rad)
    return 0.0, pitch_deg, -s.trace.depth_error_m, 0.0, cross_m, ahead, target, uint16(to_go_m)


def position_target(s: Snapshot) -> Values:
    """Depth and heading, and the end of the line or the centre of the circle where there is one."""
    wanted, path, ignored, place = s.state.setpoint, s.state.path, _ALL_BUT_DEPTH_AND_YAW, 0j
    if path is not None:
        place, ignored = (
            path.to_m if isinstance(path, TrackLine) else path.centre_m,
            ignored & ~_PLACE,
        )
    rest = (0.0,) * 6
    return (
        boot_ms(s),
        place.real,
        place.imag,
        wanted.depth_m,
        *rest,
        wanted.heading_rad,
        0.0,
        ignored,
        _GLOBAL_NED,
    )


def odometry(s: Snapshot) -> Values:
    """Velocity over ground, in body axes."""
    at = s.state.estimate
    velocity = rotate_back(at.attitude, (at.north_rate_mps, at.east_rate_mps, at.depth_rate_mps))
    level = plot.velocity_sd_mps(at.navigation, at.speed_mps, s.state.time_us)
    pose = _diagonal(
        at.position_sd_m, at.position_sd_m, _DEPTH_SD_M, _TILT_SD_RAD, _TILT_SD_RAD, _HEADING_SD_RAD
    )
    motion = _diagonal(level, level, level, math.nan, math.nan, math.nan)
    return (
        time_us(s),
        at.north_m,
        at.east_m,
        at.depth_m,
        at.attitude,
        *velocity,
        at.p_radps,
        at.q_radps,
        at.r_radps,
        pose,
        motion,
        _GLOBAL_NED,
        _CHILD_FRD,
        0,
        0,
        0,
    )


def _diagonal(*sds: float) -> tuple[float, ...]:
    """The upper triangle of a covariance, row by row, of six standard deviations."""
    return tuple(
        sds[row] ** 2 if row == column else 0.0 for row in range(6) for column in range(row, 6)
    )


def estimator_status(s: Snapshot) -> Values:
    at = s.state.estimate
    flags = _ALWAYS if at.initialised else 0
    flags |= _ABSOLUTE if s.state.home.known else 0
    flags |= 0 if depth_unknown(s.state, s.config) else _DEEP
    flags |= 0 if at.altitude_m is None else _ABOVE_FLOOR
    flags |= _GLITCH if at.navigation.fixes_rejected else 0
    return time_us(s), *_NO_RATIOS, at.position_sd_m, _DEPTH_SD_M, flags


def current(s: Snapshot) -> Values:
    """The estimated current, where the wind's velocity goes: towards north and east."""
    at = s.state.estimate
    drift, sd = at.navigation.current_mps, plot.current_sd_mps(at.navigation)
    return (
        time_us(s),
        drift.real,
        drift.imag,
        math.nan,
        math.nan,
        math.nan,
        -at.depth_m,
        sd,
        math.nan,
    )
