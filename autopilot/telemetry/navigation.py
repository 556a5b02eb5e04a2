"""Position, velocity, path and their uncertainties as messages."""

import math

from autopilot.control import guidance
from autopilot.control import navigation as dead_reckoning
from autopilot.control.failsafe import depth_unknown
from autopilot.control.setpoints import TrackLine
from autopilot.reports import Snapshot
from autopilot.telemetry.encoding import Report, boot_ms, int16, time_us, uint16
from autopilot.telemetry.tick_messages import DEPTH_SD_M
from mavlink_io.dialect import Values, constant

_GLOBAL_NED = constant("MAV_FRAME_LOCAL_NED")
_ALL_BUT_DEPTH_AND_YAW = 0b1001_1111_1011
"""POSITION_TARGET_TYPEMASK: fields that are ignored."""
_XY = 0b11
"""POSITION_TARGET_TYPEMASK: x and y."""
_NO_RATIOS = (math.nan,) * 6
"""Innovation test ratios of ESTIMATOR_STATUS: not available."""
_ALWAYS, _ABSOLUTE, _DEPTH, _ABOVE_GROUND, _GLITCH = (
    sum(constant(f"ESTIMATOR_{name}") for name in names)
    for names in (
        ("ATTITUDE", "VELOCITY_HORIZ", "VELOCITY_VERT", "POS_HORIZ_REL", "PRED_POS_HORIZ_REL"),
        ("POS_HORIZ_ABS", "PRED_POS_HORIZ_ABS"),
        ("POS_VERT_ABS",),
        ("POS_VERT_AGL",),
        ("GPS_GLITCH",),
    )
)
"""Bits of ESTIMATOR_STATUS_FLAGS."""


def navigation(s: Report) -> Values:
    """Return NAV_CONTROLLER_OUTPUT: set-points in deg, distance to go and cross-track error in m.

    Without a path the target bearing is the heading set-point.
    """
    setpoint, path = s.setpoint, s.path
    heading_deg = target_bearing_deg = int16(math.degrees(setpoint.heading_rad))
    distance_m = cross_track_m = 0.0
    if path is not None:
        distance_m, bearing_rad, cross_track_m = guidance.progress(path, s.motion)
        target_bearing_deg = int16(math.degrees(bearing_rad))
    pitch_deg = math.degrees(s.trace.pitch_setpoint_rad)
    return (
        0.0,
        pitch_deg,
        -s.trace.depth_error_m,
        0.0,
        cross_track_m,
        heading_deg,
        target_bearing_deg,
        uint16(distance_m),
    )


def position_target(s: Report) -> Values:
    """Return POSITION_TARGET_LOCAL_NED: end of the line or centre of the circle, and heading.

    Position and depth in m, north-east-down; heading in rad.
    """
    setpoint, path, ignored, position_m = s.setpoint, s.path, _ALL_BUT_DEPTH_AND_YAW, 0j
    if path is not None:
        position_m, ignored = (
            path.to_m if isinstance(path, TrackLine) else path.centre_m,
            ignored & ~_XY,
        )
    unused = (0.0,) * 6
    return (
        boot_ms(s),
        position_m.real,
        position_m.imag,
        setpoint.depth_m,
        *unused,
        setpoint.heading_rad,
        0.0,
        ignored,
        _GLOBAL_NED,
    )


def estimator_status(s: Snapshot) -> Values:
    """Return ESTIMATOR_STATUS: flags, and standard deviations of position and depth (m)."""
    estimate = s.state.estimate
    flags = _ALWAYS if estimate.initialised else 0
    flags |= _ABSOLUTE if s.state.home.known else 0
    flags |= 0 if depth_unknown(s.state, s.config) else _DEPTH
    flags |= 0 if math.isnan(estimate.altitude_m) else _ABOVE_GROUND
    flags |= _GLITCH if estimate.navigation.fixes_rejected else 0
    return time_us(s), *_NO_RATIOS, estimate.position_sd_m, DEPTH_SD_M, flags


def current(s: Snapshot) -> Values:
    """Return WIND_COV with the estimated water current (m/s), positive towards north and east."""
    estimate = s.state.estimate
    current_mps, sd_mps = (
        estimate.navigation.current_mps,
        dead_reckoning.current_sd_mps(estimate.navigation),
    )
    return (
        time_us(s),
        current_mps.real,
        current_mps.imag,
        math.nan,
        math.nan,
        math.nan,
        -estimate.depth_m,
        sd_mps,
        math.nan,
    )
