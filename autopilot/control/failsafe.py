"""Failsafes of the vehicle and the safety envelope of a test. Pure."""

import math

from autopilot.control import guidance, modes
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import BATTERY, LEAK
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Event,
    Excitation,
    Inputs,
    Severity,
    VehicleEstimate,
)
from mavlink_io.frames import wrap_pi
from mavlink_io.jit import numeric

GCS_LOST = "ground lost"
"""Cause of the failsafe of a lost ground station."""
_GCS_LOST_MODES = (modes.HOLD, modes.SURFACE, modes.RTL)
"""Modes of FS_GCS_ACT, in the order of its values."""


def check_failsafes(
    state: AutopilotState, inputs: Inputs, config: Config
) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Change to SURFACE if the vehicle is outside its limits.

    A failsafe stays in force until the vehicle is disarmed. Exception: the loss of the ground
    station leads to the mode of FS_GCS_ACT and ends when the ground station requests a mode;
    another cause replaces it.
    """
    if not state.armed or state.failsafe not in ("", GCS_LOST):
        return state, ()
    cause = _cause(state, inputs, config)
    if cause in ("", state.failsafe):
        return state, ()
    mode = _failsafe_mode(cause, state, config)
    state, events = modes.enter(state._replace(failsafe=cause), mode)
    if mode != modes.SURFACE:
        state = guidance.hold_current(state, config)
    return state, (Event(Severity.CRITICAL, f"Failsafe: {cause} -> {mode.name}"), *events)


def _failsafe_mode(cause: str, state: AutopilotState, config: Config) -> modes.Mode:
    """Return the mode for a cause; SURFACE in place of RTL if home is unknown."""
    if cause != GCS_LOST or state.mode == modes.SURFACE.number:
        return modes.SURFACE
    mode = _GCS_LOST_MODES[config.fs_ground_action]
    return modes.SURFACE if mode == modes.RTL and not state.home.known else mode


def _cause(state: AutopilotState, inputs: Inputs, config: Config) -> str:
    """Return the first limit that is exceeded; empty if there is none."""
    if state.health.faults and (reason := _device_failsafe(state, config)):
        return reason
    if depth_unknown(state, config):
        return "depth unknown"
    if not within_limits(state.estimate, config):
        return _exceeded_limit(state.estimate, config)
    armed_s = (state.time_us - state.armed_us) / US_PER_S
    if 0.0 < config.fs_time_s < armed_s:
        return f"armed {armed_s:.0f} s"
    if inputs.ground_silent_s is not None and 0.0 < config.fs_ground_s < inputs.ground_silent_s:
        return GCS_LOST
    return ""


def _exceeded_limit(estimate: VehicleEstimate, config: Config) -> str:
    """Return the first limit of ``within_limits`` that is exceeded."""
    if estimate.depth_m > config.fs_depth_m:
        return f"depth {estimate.depth_m:.1f} m"
    if estimate.altitude_m < config.fs_altitude_m:
        return f"altitude {estimate.altitude_m:.1f} m"
    return f"pitch {math.degrees(estimate.pitch_rad):.0f} deg"


def _device_failsafe(state: AutopilotState, config: Config) -> str:
    """Return a confirmed leak or low battery if its action is to surface; else empty."""
    active = monitor.active_faults(state.health)
    actions = (
        (LEAK, config.fs_leak_action),
        (BATTERY, config.fs_battery_action if active.get(BATTERY) == monitor.LOW else 0),
    )
    return next(
        (f"{name} {active[name]}" for name, action in actions if action and name in active), ""
    )


def depth_unknown(state: AutopilotState, config: Config) -> bool:
    """Return whether depth was not measured for FS_PRESS_S, and FS_PRESS_ACT is set."""
    unmeasured_us = state.time_us - state.estimate.depth_time_us
    return bool(config.fs_pressure_action) and unmeasured_us > config.fs_pressure_s * US_PER_S


@numeric
def within_limits(estimate: VehicleEstimate, config: Config) -> bool:
    """Return whether no limit of the motion (FS_DEPTH_M, FS_ALT_M, FS_PITCH_DEG) is exceeded."""
    return not (
        estimate.depth_m > config.fs_depth_m
        or estimate.altitude_m < config.fs_altitude_m
        or abs(estimate.pitch_rad) > config.fs_pitch_rad
    )


@numeric
def within_envelope(
    heading_rad: float, elapsed_s: float, estimate: VehicleEstimate, config: Config
) -> bool:
    """Return whether a test is within its envelope; see ``envelope_violation``."""
    change_rad = abs(wrap_pi(estimate.heading_rad - heading_rad))
    rate_degps = math.degrees(max(abs(estimate.q_radps), abs(estimate.r_radps)))
    return not (
        estimate.depth_m < config.sid_depth_min_m
        or estimate.depth_m > config.sid_depth_max_m
        or estimate.altitude_m < config.sid_altitude_min_m
        or abs(estimate.pitch_rad) > math.radians(config.sid_pitch_max_deg)
        or change_rad > math.radians(config.sid_heading_max_deg)
        or rate_degps > config.sid_rate_max_degps
        or elapsed_s > config.sid_time_max_s
    )


def envelope_violation(test: Excitation, state: AutopilotState, config: Config) -> str:
    """Return which limit of a test is exceeded, with value and limit; empty if none is."""
    estimate, elapsed_s = state.estimate, (state.time_us - test.started_us) / US_PER_S
    if within_envelope(test.heading_rad, elapsed_s, estimate, config):
        return ""
    if estimate.depth_m < config.sid_depth_min_m:
        return f"depth {estimate.depth_m:.1f} m above {config.sid_depth_min_m:g} m"
    if estimate.depth_m > config.sid_depth_max_m:
        return f"depth {estimate.depth_m:.1f} m below {config.sid_depth_max_m:g} m"
    if estimate.altitude_m < config.sid_altitude_min_m:
        return f"altitude {estimate.altitude_m:.1f} m under {config.sid_altitude_min_m:g} m"
    if abs(estimate.pitch_rad) > math.radians(config.sid_pitch_max_deg):
        pitch_deg = math.degrees(estimate.pitch_rad)
        return f"pitch {pitch_deg:.0f} deg beyond {config.sid_pitch_max_deg:g} deg"
    if abs(wrap_pi(estimate.heading_rad - test.heading_rad)) > math.radians(
        config.sid_heading_max_deg
    ):
        change_deg = math.degrees(wrap_pi(estimate.heading_rad - test.heading_rad))
        return f"heading {change_deg:.0f} deg off, beyond {config.sid_heading_max_deg:g} deg"
    rate_degps = math.degrees(max(abs(estimate.q_radps), abs(estimate.r_radps)))
    if rate_degps > config.sid_rate_max_degps:
        return f"rate {rate_degps:.0f} deg/s beyond {config.sid_rate_max_degps:g} deg/s"
    return f"time {elapsed_s:.0f} s beyond {config.sid_time_max_s:g} s"
