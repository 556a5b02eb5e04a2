"""Mode SURFACE: rise under power, or by buoyancy where power does not raise the vehicle, and end.

Pure, part of the tick.

SURFACE ends in one of four ways, each with disarming:

- the measured depth is less than SURF_DEPTH_M;
- depth is not measured, and a satellite fix arrives;
- the measured depth stays, and a satellite fix holds for SURF_FIX_S: the depth reading is wrong,
  because satellites are received at the surface only;
- the vehicle has not risen for SURF_TIME_S.

A buoyant vehicle (SURF_BUOY_N) that has not risen for SURF_RISE_S under power stops its propeller:
an elevator that is stuck or off can hold it down for as long as the propeller turns.
"""

import math

from autopilot.control import failsafe, modes
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor, sensor_checks
from autopilot.control.types import US_PER_S, Ascent, AutopilotState, Event, Severity

RISE_M = 0.2
"""Decrease of the least depth so far that counts as a rise.

An ascent rises that much within SURF_RISE_S. A vehicle that only moves up and down, in waves or on
the sea floor, does so a few times at most.
"""
NOT_RISING = "not rising"
"""Cause of the failsafe of a vehicle that does not rise."""

Events = tuple[Event, ...]


def step_surface(state: AutopilotState, config: Config) -> tuple[AutopilotState, Events]:
    """Set the set-points of mode SURFACE, and end it at the surface or at a time limit.

    Returns the new state and the events.
    """
    blind = failsafe.depth_unknown(state, config)
    ascent = _update(state, blind)
    if surfaced := _reached_surface(state, ascent, blind, config):
        return modes.disarm(state), (surfaced,)
    still_s = (state.time_us - ascent.risen_us) / US_PER_S
    if 0.0 < config.surface_time_s < still_s:
        text = f"Failsafe: surface not reached, no rise for {config.surface_time_s:g} s -> disarmed"
        return modes.disarm(_give_up(state)), (Event(Severity.CRITICAL, text),)
    events: Events = ()
    driven = not (blind or ascent.stopped)
    if driven and config.buoyancy_n > 0.0 and 0.0 < config.surface_rise_s < still_s:
        text = f"Failsafe: no rise for {config.surface_rise_s:g} s -> propeller stopped"
        # The rise is counted from here: the vehicle may have sunk far under power.
        ascent = Ascent(state.estimate.depth_m, state.time_us, stopped=True)
        state, driven = _give_up(state), False
        events = (Event(Severity.CRITICAL, text),)
    setpoint = state.setpoint._replace(thrust=0.0, pitch_rad=0.0)
    if driven:
        cruise = config.cruise_thrust_pct / 100.0
        setpoint = state.setpoint._replace(depth_m=0.0, thrust=cruise, pitch_rad=math.nan)
    return state._replace(setpoint=setpoint, ascent=ascent), events


def _update(state: AutopilotState, blind: bool) -> Ascent:
    """Return the progress after this tick; without a depth measurement there is no rise."""
    now_us, depth_m = state.time_us, state.estimate.depth_m
    ascent = state.ascent or Ascent(depth_m, now_us)
    if not blind and depth_m < ascent.depth_m - RISE_M:
        ascent = ascent._replace(depth_m=depth_m, risen_us=now_us)
    gps = state.health.gps
    if not sensor_checks.has_fix(gps.record) or sensor_checks.is_silent(gps, now_us):
        return ascent._replace(fix_us=None) if ascent.fix_us is not None else ascent
    return ascent if ascent.fix_us is not None else ascent._replace(fix_us=gps.accepted_us)


def _reached_surface(
    state: AutopilotState, ascent: Ascent, blind: bool, config: Config
) -> Event | None:
    """Return the event of a vehicle at the surface; None while it is submerged."""
    if blind:
        if monitor.has_new_fix(state.health, state.time_us):
            return Event(Severity.INFO, "Surfaced by satellite fix: disarmed")
        return None
    depth_m = state.estimate.depth_m
    if depth_m < config.surfaced_depth_m:
        return Event(Severity.INFO, "Surfaced: disarmed")
    if config.surface_fix_s and _fix_holds(state, ascent, round(config.surface_fix_s * US_PER_S)):
        text = f"Surfaced by satellite fix, though depth reads {depth_m:.1f} m: disarmed"
        return Event(Severity.WARNING, text)
    return None


def _fix_holds(state: AutopilotState, ascent: Ascent, hold_us: int) -> bool:
    """Return whether fixes have come for ``hold_us`` without a rise in that time.

    The time is from the first fix to the newest one that differs from the one before it: a receiver
    that repeats its last fix from before a dive, or reports it late, does not count. Nor does a fix
    while the measured depth decreases: some simulators receive satellites under water.
    """
    gps, now_us = state.health.gps, state.time_us
    if ascent.fix_us is None or now_us - ascent.risen_us < hold_us:
        return False
    if now_us - gps.record.time_us > sensor_checks.SILENT_US:
        return False
    return gps.changed_us - max(ascent.fix_us, ascent.risen_us) >= hold_us


def _give_up(state: AutopilotState) -> AutopilotState:
    """Return the state with the failsafe NOT_RISING, unless another failsafe is in force."""
    if state.failsafe not in ("", failsafe.GCS_LOST):
        return state
    return state._replace(failsafe=NOT_RISING)
