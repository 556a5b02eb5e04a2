"""What goes on unchanged in mode SURFACE: rising under power, or waiting at the surface.

Everything else of the ladder (`ascent`) needs a full tick.
"""

import math
from typing import NamedTuple

from autopilot.control.ascent import (
    count_rise,
    is_afloat,
    is_blind,
    sinks_with_way,
    stays_level,
    still_sinks,
)
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor, sensor_checks
from autopilot.control.sensor_health.cross_checks import MIN_DEPTH_M
from autopilot.control.sensor_health.types import Device
from autopilot.control.types import US_PER_S, Ascent, AscentStage, AutopilotState, VehicleEstimate
from mavlink_io.jit import numeric


class AscentTask(NamedTuple):
    """Part of mode SURFACE that goes on, and the limits that end it."""

    rising: bool = False
    """Whether power raises the vehicle."""
    waiting: bool = False
    """Whether the vehicle waits at the surface with its elevator centred."""
    braking: bool = False
    """Whether the propeller brakes meanwhile."""
    has_fix: bool = False
    """Whether satellites are received."""
    rise_s: float = math.inf
    """Longest time without a rise."""
    until_us: int = monitor.NEVER_US
    """First time that needs a full tick."""
    level_until_us: int = monitor.NEVER_US
    """First time that needs a full tick while the vehicle stays level."""


NO_ASCENT = AscentTask()


def task_of(state: AutopilotState, config: Config) -> AscentTask | None:
    """Return what goes on after a tick of mode SURFACE; None if the next tick may change it.

    Parameters
    ----------
    state : AutopilotState
        State after the tick.
    config : Config
        Parameters.
    """
    progress, gps, now_us = state.ascent, state.health.devices.gps, state.time_us
    if (
        progress is None
        or progress.stage != AscentStage.POWERED
        or monitor.active_faults(state.health)
        or is_blind(state, config)
    ):
        return None
    has_fix = sensor_checks.has_position(gps) and not sensor_checks.is_silent(gps, now_us)
    if has_fix != (progress.fix_us is not None):
        return None
    if is_afloat(progress, config):
        return _waiting(state, progress, has_fix=has_fix, config=config)
    if has_fix or progress.afloat_us is not None:
        return None
    limits_s = config.surface_rise_s, config.surface_time_s
    limit_s = min((limit_s for limit_s in limits_s if limit_s > 0.0), default=math.inf)
    still_s = (now_us - progress.risen_us) / US_PER_S
    return AscentTask(rising=True, rise_s=limit_s) if still_s < limit_s else None


def _waiting(
    state: AutopilotState, progress: Ascent, *, has_fix: bool, config: Config
) -> AscentTask | None:
    """Return the limits of a wait at the surface; None if its commands are not yet given."""
    if state.setpoint.thrust > 0.0 or state.setpoint.pitch_rad != 0.0:
        return None
    braking = state.setpoint.thrust < 0.0
    assert progress.afloat_us is not None
    held_us = max(progress.afloat_us, progress.risen_us) + config.surface_hold_s * US_PER_S
    ends_us: list[float] = [monitor.NEVER_US]
    if progress.fix_us is not None and config.surface_fix_s > 0.0:
        fixed_us = max(progress.fix_us, progress.risen_us) + config.surface_fix_s * US_PER_S
        ends_us.append(fixed_us)
    if config.surface_time_s > 0.0:
        ends_us.append(progress.risen_us + config.surface_time_s * US_PER_S)
    if progress.braked_us is not None and braking:
        ends_us.append(progress.braked_us + config.surface_astern_s * US_PER_S)
    return AscentTask(
        waiting=True,
        braking=braking,
        has_fix=has_fix,
        until_us=int(min(ends_us)),
        level_until_us=int(held_us),
    )


@numeric
def goes_on(
    task: AscentTask,
    estimate: VehicleEstimate,
    least_m: float,
    risen_us: int,
    now_us: int,
    config: Config,
) -> tuple[bool, float, int]:
    """Return whether the ascent goes on unchanged, and depth and time of its last rise.

    Parameters
    ----------
    task : AscentTask
        From ``task_of``.
    estimate : VehicleEstimate
        Estimate of this tick.
    least_m, risen_us : float, int
        Depth (m) and time of the last rise before this tick.
    now_us : int
        Time of this tick.
    config : Config
        Parameters.
    """
    least_m, risen_us = count_rise(least_m, risen_us, estimate.depth_m, now_us)
    submerged = estimate.depth_m >= config.surfaced_depth_m
    if task.waiting:
        above_water = estimate.depth_m <= MIN_DEPTH_M
        changes = sinks_with_way(estimate, config) != task.braking
        ends = now_us >= task.level_until_us and stays_level(estimate)
        return not (submerged or above_water or changes or ends), least_m, risen_us
    still_s = (now_us - risen_us) / US_PER_S
    sinks = still_sinks(estimate, least_m, still_s, config)
    return submerged and still_s <= task.rise_s and not sinks, least_m, risen_us


@numeric
def receives_as_before(task: AscentTask, gps: Device, is_new: bool, now_us: int) -> bool:
    """Return whether satellites are received as at the beginning of the task.

    Parameters
    ----------
    task : AscentTask
        From ``task_of``.
    gps : Device
        History of the receiver.
    is_new : bool
        Whether a record has come in this tick.
    now_us : int
        Time of this tick.
    """
    if not (task.rising or task.waiting):
        return True
    if is_new and sensor_checks.has_position(gps) != task.has_fix:
        return False
    return not (task.has_fix and sensor_checks.is_silent(gps, now_us))
