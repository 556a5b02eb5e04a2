"""Failsafes of the vehicle and the safety envelope of a test. Pure."""

import math

from autopilot.control import fence, guidance, modes
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

FENCE = "geofence"
"""Cause of the failsafe of a vehicle that reaches its geofence."""
FENCE_CHECK_US = US_PER_S // 2
"""Interval of the checks of the geofence."""
GCS_LOST = "ground lost"
"""Cause of the failsafe of a lost ground station."""
LOOK_AHEAD_MPS = 0.15
"""Rate of descent above which limits look ahead: less is waves and noise at constant depth."""
_GCS_LOST_MODES = (modes.HOLD, modes.SURFACE, modes.RTL)
"""Modes of FS_GCS_ACT, in the order of its values."""


def check_failsafes(
    state: AutopilotState, inputs: Inputs, config: Config
) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Change to SURFACE if the vehicle is outside its limits.

    A failsafe stays in force until the vehicle is disarmed. Exception: the loss of the ground
    station leads to the mode of FS_GCS_ACT and ends when the ground station requests a mode or a
    set-point; another cause replaces it, and its HOLD changes to SURFACE after FS_GCS_HOLD_S.
    """
    if not state.armed or state.failsafe not in ("", GCS_LOST, FENCE):
        return state, ()
    cause = _cause(state, inputs, config)
    if state.fence.zones and cause in ("", GCS_LOST) and state.time_us >= state.fence_us:
        state, report = _check_fence(state, config)
        if report is not None:
            return state, report
    if cause in ("", state.failsafe) or (cause, state.failsafe) == (GCS_LOST, FENCE):
        return _end_hold(state, config)
    mode = _failsafe_mode(cause, state, config)
    state = state._replace(failsafe=cause, failsafe_us=state.time_us)
    state, events = modes.enter(state, mode)
    if mode != modes.SURFACE:
        state = guidance.hold_current(state, config)
    return state, (Event(Severity.CRITICAL, f"Failsafe: {cause} -> {mode.name}"), *events)


def _end_hold(state: AutopilotState, config: Config) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Change to SURFACE after FS_GCS_HOLD_S in the HOLD of a lost ground station.

    The time counts from the failsafe, whether or not heartbeats come again: a ground station
    without an operator sends them too.
    """
    held_s = (state.time_us - state.failsafe_us) / US_PER_S
    holds = state.failsafe == GCS_LOST and state.mode == modes.HOLD.number
    if not (holds and 0.0 < config.fs_ground_hold_s < held_s):
        return state, ()
    state, events = modes.enter(state, modes.SURFACE)
    text = f"Failsafe: {GCS_LOST}, HOLD for {config.fs_ground_hold_s:g} s -> SURFACE"
    return state, (Event(Severity.CRITICAL, text), *events)


def _check_fence(
    state: AutopilotState, config: Config
) -> tuple[AutopilotState, tuple[Event, ...] | None]:
    """Check the geofence now and FS_LOOK_S ahead; the events are None if nothing happens.

    A vehicle on its way back or up is not checked again. With FENCE_ACTION 0 each check reports.
    """
    state = state._replace(fence_us=state.time_us + FENCE_CHECK_US)
    if state.failsafe == FENCE or not (text := fence_breach(state, config)):
        return state, None
    if config.fence_action and state.mode == modes.SURFACE.number:
        return state, None
    state = state._replace(fence_breaches=state.fence_breaches + 1, fence_breach_us=state.time_us)
    if not config.fence_action:
        state = state._replace(fence_us=state.time_us + 10 * US_PER_S)
        return state, (Event(Severity.WARNING, f"Geofence: {text}"),)
    mode = modes.RTL if config.fence_action == 2 and state.home.known else modes.SURFACE
    state, events = modes.enter(state._replace(failsafe=FENCE), mode)
    if mode != modes.SURFACE:
        state = guidance.hold_current(state, config)
    return state, (Event(Severity.CRITICAL, f"Failsafe: {text} -> {mode.name}"), *events)


def fence_breach(state: AutopilotState, config: Config, *, ahead: bool = True) -> str:
    """Return which zone of the geofence forbids the position; empty if none does.

    Parameters
    ----------
    state : AutopilotState
        State with estimate, home and geofence.
    config : Config
        Parameter FS_LOOK_S.
    ahead : bool
        Whether to check the position after FS_LOOK_S at the present velocity too.

    Returns
    -------
    str
        Reason with the zone.
    """
    if not (state.fence.zones and state.home.known):
        return ""
    at, home = state.estimate, (state.home.lat_deg, state.home.lon_deg)
    position_m = guidance.position_of(at)
    if text := fence.breach(state.fence, position_m, home):
        return text
    if not ahead:
        return ""
    way_m = complex(at.north_rate_mps, at.east_rate_mps) * config.fs_look_s
    text = fence.breach(state.fence, position_m + way_m, home)
    return f"{text} in {config.fs_look_s:g} s" if text else ""


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
    return GCS_LOST if ground_lost(inputs.ground_silent_s, config) else ""


def ground_lost(silent_s: float | None, config: Config) -> bool:
    """Return whether a ground station has been silent for longer than the limit.

    Parameters
    ----------
    silent_s : float or None
        Wall time since its last heartbeat; None before the first.
    config : Config
        Parameters.

    Returns
    -------
    bool
        True if the failsafe may begin.
    """
    return silent_s is not None and 0.0 < config.fs_ground_s < silent_s


def _exceeded_limit(estimate: VehicleEstimate, config: Config) -> str:
    """Return the first limit of ``within_limits`` that is exceeded, with the value compared."""
    ahead_m = sinking_m(estimate, config)
    ahead = f" in {config.fs_look_s:g} s" if ahead_m else ""
    if estimate.depth_m + ahead_m > max_depth_m(config):
        return f"depth {estimate.depth_m + ahead_m:.1f} m{ahead}"
    if estimate.altitude_m - ahead_m < config.fs_altitude_m:
        return f"altitude {estimate.altitude_m - ahead_m:.1f} m{ahead}"
    return f"pitch {math.degrees(estimate.pitch_rad):.0f} deg"


def _device_failsafe(state: AutopilotState, config: Config) -> str:
    """Return a confirmed leak, dive or low battery if its action is to surface; else empty."""
    active = monitor.active_faults(state.health)
    actions = (
        (LEAK, config.fs_leak_action),
        (monitor.ELEVATOR, 1),
        (monitor.PITCH, 1),
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
def max_depth_m(config: Config) -> float:
    """Return the maximum depth (m): the lesser one of FS_DEPTH_M and FENCE_DPT_MAX."""
    fence_m = config.fence_max_m
    return min(config.fs_depth_m, fence_m) if fence_m > 0.0 else config.fs_depth_m


@numeric
def sinking_m(estimate: VehicleEstimate, config: Config) -> float:
    """Return how far the vehicle sinks before a recovery ends: w T for w > w_0, else 0.

    w is the rate of descent, T = FS_LOOK_S and w_0 = ``LOOK_AHEAD_MPS``.
    """
    rate_mps = estimate.depth_rate_mps
    return rate_mps * config.fs_look_s if rate_mps > LOOK_AHEAD_MPS else 0.0


@numeric
def within_limits(estimate: VehicleEstimate, config: Config) -> bool:
    """Return whether no limit of the motion (FS_DEPTH_M, FS_ALT_M, FS_PITCH_DEG) is exceeded.

    Depth and altitude are those after FS_LOOK_S at the present rate of descent (``sinking_m``).
    """
    ahead_m = sinking_m(estimate, config)
    return not (
        estimate.depth_m + ahead_m > max_depth_m(config)
        or estimate.altitude_m - ahead_m < config.fs_altitude_m
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
