"""Metrics of a simulated dive: steady errors, settling of legs, surface activity and failures."""

import math
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import deflection_limit
from sysid.data.dataset import Log
from sysid.monitor import tracking_metrics
from sysid.monitor.tracking_metrics import SteadyInterval, TrackingErrors
from sysid.monte_carlo.simulate import SimulatedDive
from sysid.test_design.safety_margins import HOLDING_LIMITS

Array = NDArray[np.float64]

SETTLED_RAD, SETTLED_M = math.radians(3.0), 0.3
"""Largest heading (rad) and depth error (m) of a settled leg, from settling to its end."""
SETTLED_FOR_S = 5.0
"""Minimum time (s) between settling and the end of the leg."""
MIN_STEADY_S = 15.0
"""Minimum length (s) of steady flight in which divergence is evaluated."""
MAX_SATURATED_FRACTION = 0.2
"""Share of steady flight at a limit of the command above which the loop counts as a limit cycle."""
SATURATED_SHARE = 0.999
"""Share of a limit above which a command counts as being at it."""
AT_DEPTH_M = 0.3
"""Largest depth error (m) at which the vehicle counts as dived; afterwards it must not broach."""


class Leg(NamedTuple):
    """One stretch of constant set-points below the surface."""

    heading_deg: float
    depth_m: float
    settling_s: float | None
    """Settling time (s) from the start of the leg; None if the vehicle did not settle."""


class Steady(NamedTuple):
    """95 % of the error after settling, defined as in ``sysid.monitor.tracking_metrics``."""

    heading_deg: float
    pitch_deg: float
    depth_m: float


class DiveMetrics(NamedTuple):
    """Metrics of one dive."""

    steady: Steady | None
    """None if no leg outlasts its settling time."""
    legs: tuple[Leg, ...]
    rudder_deg: float
    elevator_deg: float
    """Largest command of the rudder and of the elevator (deg)."""
    stopped: float
    """Share of the dive in which either surface was at its stop."""
    shallowest_m: float | None
    """Smallest true depth after diving (m); None if the vehicle did not dive."""
    broached: bool
    """Whether the hull came through the surface after diving."""
    diverged: str
    """First quantity that was not held: heading, pitch, depth or the mission's time, or empty."""
    failsafe: str
    """Failsafe that ended the mission, without its numbers; empty if none."""
    seconds: float


def of_dive(
    dive: SimulatedDive,
    travel_rad: float,
    hull_radius_m: float,
    settling_s: float = tracking_metrics.SETTLING_S,
) -> DiveMetrics:
    """Return the metrics of a dive.

    Parameters
    ----------
    dive : SimulatedDive
        Simulated dive.
    travel_rad : float
        Travel of the surfaces (rad).
    hull_radius_m : float
        Radius of the hull (m).
    settling_s : float
        Time excluded after each change of set-point (s).

    Returns
    -------
    DiveMetrics
        Metrics of the dive.
    """
    log = dive.log
    rudder, elevator = np.abs(log.actuators.rudder_rad), np.abs(log.actuators.elevator_rad)
    shallowest_m = _shallowest_m(dive)
    return DiveMetrics(
        steady=_steady(log, settling_s),
        legs=tuple(_leg(log, leg) for leg in tracking_metrics.intervals(log, settling_s=0.0)),
        rudder_deg=math.degrees(float(np.max(rudder))),
        elevator_deg=math.degrees(float(np.max(elevator))),
        stopped=float(np.mean(np.maximum(rudder, elevator) > SATURATED_SHARE * travel_rad)),
        shallowest_m=shallowest_m,
        broached=shallowest_m is not None and shallowest_m < hull_radius_m,
        diverged=_divergence(dive, travel_rad, settling_s),
        failsafe=re.sub(r" -?\d.*", "", dive.failsafe),
        seconds=dive.seconds,
    )


def _in_window(log: Log, window: SteadyInterval) -> NDArray[np.bool_]:
    """Return a mask of the samples in a window; a simulated log has one time base."""
    time_s = log.attitude.time_s
    return (time_s >= window.start_s) & (time_s < window.stop_s)


def _heading_error_rad(log: Log) -> Array:
    """Return the error from the current set-point, which changes while a path is followed."""
    error = log.attitude.yaw_rad - log.setpoints.heading_rad
    return np.asarray((error + math.pi) % (2.0 * math.pi) - math.pi)


def _steady(log: Log, settling_s: float) -> Steady | None:
    """Return the steady errors, or None."""
    windows = tracking_metrics.intervals(log, settling_s)
    if not windows:
        return None
    errors = [_errors(log, window) for window in windows]
    in_windows = np.any([_in_window(log, window) for window in windows], axis=0)
    return Steady(
        _p95(np.degrees(_heading_error_rad(log)[in_windows])),
        _p95(np.concatenate([error.pitch_deg for error in errors])),
        _p95(np.concatenate([error.depth_m for error in errors])),
    )


def _errors(log: Log, window: SteadyInterval) -> TrackingErrors:
    """Return the errors in a window."""
    return tracking_metrics.errors_in(log, window.start_s, window.stop_s)


def _p95(error: Array) -> float:
    """Return the distance from zero of 95 % of the samples."""
    return tracking_metrics.spread(error).p95


def _leg(log: Log, window: SteadyInterval) -> Leg:
    """Return the settling of one leg."""
    unsettled = np.abs(_heading_error_rad(log)) > SETTLED_RAD
    unsettled |= np.abs(log.depth.depth_m - window.depth_setpoint_m) > SETTLED_M
    unsettled_s = log.attitude.time_s[unsettled & _in_window(log, window)]
    last_s = float(unsettled_s[-1]) if unsettled_s.size else window.start_s
    settled = window.stop_s - last_s >= SETTLED_FOR_S
    return Leg(
        window.heading_setpoint_deg,
        window.depth_setpoint_m,
        last_s - window.start_s if settled else None,
    )


def _shallowest_m(dive: SimulatedDive) -> float | None:
    """Return the smallest true depth after the first commanded depth was reached, or None."""
    setpoint_m = dive.log.setpoints.depth_m
    dived = (np.abs(dive.true_depth_m - setpoint_m) < AT_DEPTH_M) & (
        setpoint_m > tracking_metrics.SUBMERGED_M
    )
    if not np.any(dived):
        return None
    return float(np.min(dive.true_depth_m[int(np.argmax(dived)) :]))


def _divergence(dive: SimulatedDive, travel_rad: float, settling_s: float) -> str:
    """Return the first quantity that was not held after settling."""
    log, limit_rad = dive.log, SATURATED_SHARE * deflection_limit.REDUCED * travel_rad
    for window in tracking_metrics.intervals(log, settling_s, MIN_STEADY_S):
        in_window, errors = _in_window(log, window), _errors(log, window)
        rudder, elevator = (
            float(np.mean(np.abs(command[in_window]) > limit_rad))
            for command in (log.actuators.rudder_rad, log.actuators.elevator_rad)
        )
        if (
            np.max(np.abs(_heading_error_rad(log)[in_window])) > HOLDING_LIMITS.heading_rad
            or rudder > MAX_SATURATED_FRACTION
        ):
            return "heading"
        if (
            np.max(np.abs(errors.pitch_deg)) > math.degrees(HOLDING_LIMITS.pitch_rad)
            or elevator > MAX_SATURATED_FRACTION
        ):
            return "pitch"
        if np.max(np.abs(errors.depth_m)) > HOLDING_LIMITS.down_m:
            return "depth"
    return "" if dive.finished or dive.failsafe else "the mission's time"
