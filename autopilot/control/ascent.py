"""Mode SURFACE: rise under power, escalate where that does not raise the vehicle, and end.

Pure, part of the tick. The stages (``AscentStage``) are tried in this order:

1. Power, with the depth set-point 0.
2. Power does not raise the vehicle, and it is not afloat: no rise for SURF_RISE_S, or it sinks
   against its elevator (``monitor.dives``), or it sinks after twice FS_LOOK_S. A vehicle that
   floats up (SURF_BUOY_N, or a drop weight) stops its propeller: an elevator that is stuck or off
   can hold it down for as long as the propeller turns. If it sinks nose down, the propeller runs
   astern first, for SURF_ASTERN_S at most.
   While the vehicle waits at the surface, the propeller brakes whenever it sinks and still moves
   ahead: with its elevator centred such a vehicle dips below the surface, and one that is heavy at
   the nose dives. It brakes only within SURF_ASTERN_S of the first time, because an estimate of
   speed or sinking may be wrong without end. Without power it brakes only if its nose is down.
3. No rise for SURF_DROP_S without power: the drop weight is released, if fitted.
4. Without a drop weight, a vehicle that sinks without power tries power again. After MAX_ATTEMPTS
   stops the propeller is not stopped again: without it the vehicle would sink to the floor.

SURFACE ends in one of four ways, each with disarming:

- the measured depth is less than SURF_DEPTH_M, not above the water, and has not decreased further
  for SURF_HOLD_S. Meanwhile a vehicle that floats up has its propeller stopped, or braking, and its
  elevator centred, as after disarming. It may dip while it moves ahead, and must not drop its nose
  at the end;
- depth is not measured, or its sensor has a fault, and a satellite fix arrives;
- the measured depth stays, and a satellite fix holds for SURF_FIX_S: satellites are received at the
  surface only, so a depth reading above SURF_DEPTH_M is wrong, which the text says;
- the vehicle has not risen for SURF_TIME_S. A propeller that is not stopped again, and that holds
  the vehicle just below the surface, runs on.
"""

import math

from autopilot.control import failsafe, mission, modes
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor, sensor_checks
from autopilot.control.sensor_health.cross_checks import MIN_DEPTH_M
from autopilot.control.types import (
    US_PER_S,
    Ascent,
    AscentStage,
    AutopilotState,
    Event,
    Events,
    Rest,
    Severity,
    VehicleEstimate,
)
from mavlink_io.jit import numeric

RISE_M = 0.2
"""Decrease of the least depth so far that counts as a rise.

An ascent rises that much within SURF_RISE_S. A vehicle that only moves up and down, in waves or on
the sea floor, does so a few times at most.
"""
NOSE_DOWN_RAD = math.radians(-10.0)
"""Pitch below which the propeller astern lifts the vehicle."""
LEVEL_RAD = math.radians(-5.0)
"""Pitch above which a vehicle that moves ahead stays at the surface, its elevator centred."""
MIN_ASTERN_S = 2.0
"""Shortest time astern, so that heave while the vehicle pitches does not change the stage often."""
ASTERN_EFFECT_S = 6.0
"""Time after which thrust astern has stopped the sinking, or has no effect: it takes 2 to 4 s."""
PITCH_AHEAD_S = 2.0
"""Time for which the pitch is predicted."""
MIN_WAY_MPS = 0.3
"""Speed through the water below which a vehicle is too slow to dive."""
RECOVERIES = 2.0
"""Multiple of FS_LOOK_S, the time of a recovery, after which a vehicle that sinks does not recover.
"""
SUNK_M = 1.0
"""Increase of depth without power after which power is tried again.

A vehicle that floats up and still moves ahead may dip by half of it before it stops.
"""
AFLOAT_MARGIN_M = 0.5
"""Depth below SURF_DEPTH_M at which a vehicle is no longer at the surface: waves cover it."""
MAX_ATTEMPTS = 3
"""Maximum number of times that the propeller is stopped."""
NOT_RISING = "not rising"
"""Cause of the failsafe of a vehicle that does not rise."""


def step_surface(state: AutopilotState, config: Config) -> tuple[AutopilotState, Events]:
    """Set the set-points of mode SURFACE, and end it at the surface or at a time limit.

    Returns the new state and the events.
    """
    blind = is_blind(state, config)
    ascent = _update(state, blind, config)
    if surfaced := _reached_surface(state, ascent, blind, config):
        # a depth that contradicts the satellites must not move the fins of a vehicle on deck
        rest = Rest() if state.estimate.depth_m < config.surfaced_depth_m else None
        state, mission_events = mission.end_at_surface(state)
        return modes.disarm(state)._replace(rest=rest), (*mission_events, surfaced)
    still_s = (state.time_us - ascent.risen_us) / US_PER_S
    stage, reason = _next_stage(state, ascent, blind, config)
    events: Events = ()
    if reason:
        state, ascent, events = _enter(state, ascent, stage, reason)
    elif 0.0 < config.surface_time_s < still_s and not _held_by_power(state, ascent, config):
        text = f"Failsafe: surface not reached, no rise for {config.surface_time_s:g} s -> disarmed"
        state = modes.disarm(_give_up(state))._replace(rest=Rest())
        return state, (Event(Severity.CRITICAL, text),)
    cruise = config.cruise_thrust_pct / 100.0
    setpoint = state.setpoint._replace(thrust=0.0, pitch_rad=0.0)
    powered, afloat = ascent.stage == AscentStage.POWERED, is_afloat(ascent, config)
    brakes = powered and afloat and _brakes(state, ascent, config)
    if brakes and ascent.braked_us is None:
        ascent = ascent._replace(braked_us=state.time_us)
    if brakes or ascent.stage == AscentStage.ASTERN:
        setpoint = setpoint._replace(thrust=-cruise)
    elif not (blind or afloat):
        # without power too: the nose goes up, in case the vehicle moves or its propeller is stuck
        thrust = cruise if powered else 0.0
        setpoint = state.setpoint._replace(depth_m=0.0, thrust=thrust, pitch_rad=math.nan)
    return state._replace(setpoint=setpoint, ascent=ascent), events


def rests(state: AutopilotState, config: Config) -> bool:
    """Return whether the elevator is centred: at the surface, or because the pitch is wrong.

    The vehicle waits at the surface with its propeller stopped. A wrong pitch would command the
    elevator of a vehicle without power down.

    Parameters
    ----------
    state : AutopilotState
        State of this tick.
    config : Config
        Parameters.
    """
    ascent = state.ascent
    if ascent is None or state.mode != modes.SURFACE.number:
        return False
    unpowered = ascent.stage in (AscentStage.STOPPED, AscentStage.RELEASED)
    return is_afloat(ascent, config) or (unpowered and _pitch_is_wrong(state))


def _pitch_is_wrong(state: AutopilotState) -> bool:
    """Return whether the depth has contradicted the pitch since arming."""
    return monitor.PITCH in monitor.active_faults(state.health)


def is_blind(state: AutopilotState, config: Config) -> bool:
    """Return whether the depth must not be used: it is unknown, or its sensor has a fault.

    A vehicle that floats up does not need it: a few samples in many seconds are worth less than a
    satellite fix.

    Parameters
    ----------
    state : AutopilotState
        State of this tick.
    config : Config
        Parameters.
    """
    faulty = monitor.PRESSURE in monitor.active_faults(state.health)
    floats_up = bool(config.fs_pressure_action) and config.buoyancy_n > 0.0
    return failsafe.depth_unknown(state, config) or (faulty and floats_up)


def _next_stage(
    state: AutopilotState, ascent: Ascent, blind: bool, config: Config
) -> tuple[AscentStage, str]:
    """Return the stage that follows and the reason; an empty reason: the present stage goes on."""
    stage, estimate = ascent.stage, state.estimate
    still_s = (state.time_us - ascent.risen_us) / US_PER_S
    stage_s = (state.time_us - ascent.began_us) / US_PER_S
    buoyant = config.buoyancy_n > 0.0 or config.weight_fitted
    if stage == AscentStage.POWERED:
        dives = monitor.ELEVATOR in monitor.active_faults(state.health)
        stopped = AscentStage.ASTERN if _astern_helps(state, config) else AscentStage.STOPPED
        if blind:
            return _release(state, ascent, still_s, config)
        if not buoyant or ascent.attempts >= MAX_ATTEMPTS or is_afloat(ascent, config):
            return stage, ""
        if _pitch_is_wrong(state):
            return AscentStage.STOPPED, "pitch disagrees with the depth"
        if dives:
            return stopped, "sinks against the elevator"
        if 0.0 < config.surface_rise_s < still_s:
            return stopped, f"no rise for {config.surface_rise_s:g} s"
        if still_sinks(estimate, ascent.depth_m, still_s, config):
            return stopped, f"still sinks after {still_s:.0f} s"
    elif stage == AscentStage.ASTERN:
        helps = stage_s < MIN_ASTERN_S or _astern_helps(state, config)
        fails = stage_s > ASTERN_EFFECT_S and estimate.depth_rate_mps > monitor.NOSE_UP_SINKING_MPS
        if stage_s > config.surface_astern_s or fails or not helps:
            return AscentStage.STOPPED, f"astern for {stage_s:.0f} s"
    elif stage == AscentStage.STOPPED:
        released, reason = _release(state, ascent, still_s, config)
        if reason:
            return released, reason
        if not blind and _dives_by_way(state, config):
            return AscentStage.ASTERN, "sinks nose down"
        sunk_m = estimate.depth_m - ascent.depth_m
        if (
            not blind
            and ascent.attempts <= MAX_ATTEMPTS
            and sunk_m > SUNK_M
            and 0.0 < config.surface_rise_s < still_s
            and estimate.depth_rate_mps > 0.0
        ):
            return AscentStage.POWERED, f"sank {sunk_m:.1f} m without power"
    return stage, ""


def _release(
    state: AutopilotState, ascent: Ascent, still_s: float, config: Config
) -> tuple[AscentStage, str]:
    """Return the stage after the drop weight is released, and the reason, if that is due."""
    if not config.weight_fitted or state.weight_released or still_s < config.weight_time_s:
        return ascent.stage, ""
    return AscentStage.RELEASED, f"no rise for {config.weight_time_s:g} s without power"


@numeric
def _sinks(estimate: VehicleEstimate, config: Config) -> bool:
    """Return whether the vehicle sinks, and its propeller may run astern."""
    return config.surface_astern_s > 0.0 and estimate.depth_rate_mps > 0.0


def _astern_helps(state: AutopilotState, config: Config) -> bool:
    """Return whether the vehicle sinks nose down, so that thrust astern pulls it up."""
    return _sinks(state.estimate, config) and state.estimate.pitch_rad < NOSE_DOWN_RAD


@numeric
def sinks_with_way(estimate: VehicleEstimate, config: Config) -> bool:
    """Return whether the vehicle sinks while it moves ahead.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimate of this tick.
    config : Config
        Parameters.
    """
    return _sinks(estimate, config) and estimate.speed_mps > MIN_WAY_MPS


def _brakes(state: AutopilotState, ascent: Ascent, config: Config) -> bool:
    """Return whether a vehicle at the surface brakes: it sinks, moves ahead and has time left."""
    first_us = state.time_us if ascent.braked_us is None else ascent.braked_us
    in_time = state.time_us - first_us <= config.surface_astern_s * US_PER_S
    return in_time and sinks_with_way(state.estimate, config)


def _dives_by_way(state: AutopilotState, config: Config) -> bool:
    """Return whether the vehicle sinks nose down because it moves ahead."""
    return _astern_helps(state, config) and sinks_with_way(state.estimate, config)


_ACTIONS = {
    AscentStage.POWERED: "power",
    AscentStage.ASTERN: "propeller astern",
    AscentStage.STOPPED: "propeller stopped",
    AscentStage.RELEASED: "weight released",
}


def _enter(
    state: AutopilotState, ascent: Ascent, stage: AscentStage, reason: str
) -> tuple[AutopilotState, Ascent, Events]:
    """Begin a stage.

    The rise is counted from its beginning: the vehicle may have sunk far in the stage before it.
    """
    attempts = ascent.attempts + (ascent.stage == AscentStage.POWERED)
    ascent = Ascent(
        state.estimate.depth_m,
        state.time_us,
        ascent.fix_us,
        stage=stage,
        began_us=state.time_us,
        attempts=attempts,
    )
    state = _give_up(state)
    if stage == AscentStage.RELEASED:
        state = state._replace(weight_released=True)
    return state, ascent, (Event(Severity.CRITICAL, f"Failsafe: {reason} -> {_ACTIONS[stage]}"),)


def _update(state: AutopilotState, blind: bool, config: Config) -> Ascent:
    """Return the progress after this tick; without a depth measurement there is no rise."""
    now_us, depth_m = state.time_us, state.estimate.depth_m
    ascent = state.ascent or Ascent(depth_m, now_us)
    if not blind:
        least_m, risen_us = count_rise(ascent.depth_m, ascent.risen_us, depth_m, now_us)
        ascent = ascent._replace(depth_m=least_m, risen_us=risen_us)
    afloat_us = ascent.afloat_us
    margin_m = SUNK_M if is_afloat(ascent, config) else AFLOAT_MARGIN_M
    left = not MIN_DEPTH_M < depth_m < config.surfaced_depth_m + margin_m
    if blind or (left and not (is_afloat(ascent, config) and _dives_by_way(state, config))):
        afloat_us = None
    elif afloat_us is None and depth_m < config.surfaced_depth_m:
        afloat_us = now_us
    if afloat_us != ascent.afloat_us:
        ascent = ascent._replace(afloat_us=afloat_us, braked_us=None)
    gps = state.health.devices.gps
    if not sensor_checks.has_position(gps) or sensor_checks.is_silent(gps, now_us):
        return ascent._replace(fix_us=None) if ascent.fix_us is not None else ascent
    return ascent if ascent.fix_us is not None else ascent._replace(fix_us=gps.accepted_us)


@numeric
def count_rise(least_m: float, risen_us: int, depth_m: float, now_us: int) -> tuple[float, int]:
    """Return depth and time of the last rise after a tick.

    Parameters
    ----------
    least_m, risen_us : float, int
        Depth (m) and time of the last rise before it.
    depth_m : float
        Depth.
    now_us : int
        Time of the tick.
    """
    if depth_m < least_m - RISE_M:
        return depth_m, now_us
    return least_m, risen_us


@numeric
def still_sinks(estimate: VehicleEstimate, least_m: float, still_s: float, config: Config) -> bool:
    """Return whether the vehicle sinks after the time of a recovery.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimate of this tick.
    least_m, still_s : float
        Depth of the last rise (m), and time since it.
    config : Config
        Parameters.
    """
    sinks = estimate.depth_m > least_m and estimate.depth_rate_mps > monitor.SINKING_MPS
    return sinks and 0.0 < RECOVERIES * config.fs_look_s < still_s


def is_afloat(ascent: Ascent, config: Config) -> bool:
    """Return whether the vehicle waits at the surface, held there by its buoyancy.

    Parameters
    ----------
    ascent : Ascent
        Progress of mode SURFACE.
    config : Config
        Parameters.
    """
    return ascent.afloat_us is not None and config.buoyancy_n > 0.0


def _reached_surface(
    state: AutopilotState, ascent: Ascent, blind: bool, config: Config
) -> Event | None:
    """Return the event of a vehicle at the surface; None while it is submerged."""
    if blind:
        if monitor.has_new_fix(state.health, state.time_us):
            return Event(Severity.INFO, "Surfaced by satellite fix: disarmed")
        return None
    depth_m = state.estimate.depth_m
    settled = stays_level(state.estimate) and depth_m < config.surfaced_depth_m
    held = False
    if ascent.afloat_us is not None and (settled or not is_afloat(ascent, config)):
        held_us = state.time_us - max(ascent.afloat_us, ascent.risen_us)
        held = held_us >= config.surface_hold_s * US_PER_S
    fix_us = round(config.surface_fix_s * US_PER_S)
    fixed = fix_us > 0 and _fix_holds(state, ascent, fix_us)
    if held or (fixed and depth_m < config.surfaced_depth_m):
        return Event(Severity.INFO, "Surfaced: disarmed")
    if fixed:
        text = f"Surfaced by satellite fix, though depth reads {depth_m:.1f} m: disarmed"
        return Event(Severity.WARNING, text)
    return None


@numeric
def stays_level(estimate: VehicleEstimate) -> bool:
    """Return whether a vehicle at the surface does not drop its nose, or is too slow to dive.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimate of this tick.
    """
    pitch_rad = estimate.pitch_rad + PITCH_AHEAD_S * estimate.q_radps
    return pitch_rad > LEVEL_RAD or estimate.speed_mps < MIN_WAY_MPS


def _fix_holds(state: AutopilotState, ascent: Ascent, hold_us: int) -> bool:
    """Return whether fixes have come for ``hold_us`` without a rise in that time.

    The time is from the first fix to the newest one that differs from the one before it: a receiver
    that repeats its last fix from before a dive, or reports it late, does not count. Nor does a fix
    while the measured depth decreases: some simulators receive satellites under water.
    """
    gps, now_us = state.health.devices.gps, state.time_us
    if ascent.fix_us is None or now_us - ascent.risen_us < hold_us:
        return False
    if now_us - gps.record.time_us > sensor_checks.SILENT_US:
        return False
    return gps.changed_us - max(ascent.fix_us, ascent.risen_us) >= hold_us


def _held_by_power(state: AutopilotState, ascent: Ascent, config: Config) -> bool:
    """Return whether a propeller that is not stopped again holds the vehicle below the surface."""
    is_last = ascent.stage == AscentStage.POWERED and ascent.attempts >= MAX_ATTEMPTS
    return is_last and state.estimate.depth_m < config.surfaced_depth_m + AFLOAT_MARGIN_M


def _give_up(state: AutopilotState) -> AutopilotState:
    """Return the state with the failsafe NOT_RISING, unless another failsafe is in force."""
    if state.failsafe not in ("", failsafe.GCS_LOST):
        return state
    return state._replace(failsafe=NOT_RISING)
