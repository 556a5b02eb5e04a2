"""The limits that end a flight or a test, each with its reason."""

import math

from autopilot.control import guidance, modes
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import BATTERY, LEAK
from autopilot.control.types import US_PER_S, AutopilotState, Event, Excitation, Inputs, Severity
from mavlink_io.frames import wrap_pi

GCS_LOST = "ground lost"
_GCS_LOST_MODES = (modes.HOLD, modes.SURFACE, modes.RTL)
"""By FS_GCS_ACT."""


def check_failsafes(
    state: AutopilotState, inputs: Inputs, config: Config
) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Turn to SURFACE where the vehicle leaves its limits; a failsafe stays in force until it is
    disarmed.

    What a lost ground asks for is FS_GCS_ACT's choice, and ends when ground asks for a mode again;
    it does not hide what comes after it."""
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
    """The mode that answers a cause; without a known home there is no way there."""
    if cause != GCS_LOST or state.mode == modes.SURFACE.number:
        return modes.SURFACE
    mode = _GCS_LOST_MODES[config.fs_ground_action]
    return modes.SURFACE if mode == modes.RTL and not state.home.known else mode


def _cause(state: AutopilotState, inputs: Inputs, config: Config) -> str:
    if state.health.faults and (wrong := _device_failsafe(state, config)):
        return wrong
    if depth_unknown(state, config):
        return "depth unknown"
    at = state.estimate
    if at.depth_m > config.fs_depth_m:
        return f"depth {at.depth_m:.1f} m"
    if at.altitude_m is not None and at.altitude_m < config.fs_altitude_m:
        return f"altitude {at.altitude_m:.1f} m"
    if abs(at.pitch_rad) > config.fs_pitch_rad:
        return f"pitch {math.degrees(at.pitch_rad):.0f} deg"
    armed_s = (state.time_us - state.armed_us) / US_PER_S
    if 0.0 < config.fs_time_s < armed_s:
        return f"armed {armed_s:.0f} s"
    if inputs.ground_silent_s is not None and 0.0 < config.fs_ground_s < inputs.ground_silent_s:
        return GCS_LOST
    return ""


def _device_failsafe(state: AutopilotState, config: Config) -> str:
    """What the vehicle has found wrong with herself and must not stay down with."""
    wrong = monitor.active_faults(state.health)
    acted_on = (
        (LEAK, config.fs_leak_action),
        (BATTERY, config.fs_battery_action if wrong.get(BATTERY) == monitor.LOW else 0),
    )
    return next(
        (f"{name} {wrong[name]}" for name, action in acted_on if action and name in wrong), ""
    )


def depth_unknown(state: AutopilotState, config: Config) -> bool:
    """Whether the depth has not been measured for too long to go on."""
    blind_us = state.time_us - state.estimate.depth_time_us
    return bool(config.fs_pressure_action) and blind_us > config.fs_pressure_s * US_PER_S


def envelope_violation(test: Excitation, state: AutopilotState, config: Config) -> str:
    """Why a test must stop now; empty while it may go on."""
    at = state.estimate
    if at.depth_m < config.sid_depth_min_m:
        return f"depth {at.depth_m:.1f} m above {config.sid_depth_min_m:g} m"
    if at.depth_m > config.sid_depth_max_m:
        return f"depth {at.depth_m:.1f} m below {config.sid_depth_max_m:g} m"
    if at.altitude_m is not None and at.altitude_m < config.sid_altitude_min_m:
        return f"altitude {at.altitude_m:.1f} m under {config.sid_altitude_min_m:g} m"
    if abs(at.pitch_rad) > math.radians(config.sid_pitch_max_deg):
        return f"pitch {math.degrees(at.pitch_rad):.0f} deg beyond {config.sid_pitch_max_deg:g} deg"
    if abs(wrap_pi(at.heading_rad - test.heading_rad)) > math.radians(config.sid_heading_max_deg):
        turned = math.degrees(wrap_pi(at.heading_rad - test.heading_rad))
        return f"heading {turned:.0f} deg off, beyond {config.sid_heading_max_deg:g} deg"
    fastest_degps = math.degrees(max(abs(at.q_radps), abs(at.r_radps)))
    if fastest_degps > config.sid_rate_max_degps:
        return f"rate {fastest_degps:.0f} deg/s beyond {config.sid_rate_max_degps:g} deg/s"
    elapsed_s = (state.time_us - test.started_us) / US_PER_S
    if elapsed_s > config.sid_time_max_s:
        return f"time {elapsed_s:.0f} s beyond {config.sid_time_max_s:g} s"
    return ""
