"""What a rehearsed dive comes to: errors once settled, how legs settled, what the duct had to do,
what failed."""

import math
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Log
from sysid.monitor import tracking_metrics
from sysid.monitor.tracking_metrics import SteadyWindow
from sysid.monte_carlo.simulate import SimulatedDive
from sysid.test_design.safety_margins import HOLDING_LIMITS

Array = NDArray[np.float64]

SETTLED_RAD, SETTLED_M = math.radians(3.0), 0.3
"""A leg has settled when the vehicle stays this near to its heading and its depth until it ends."""
SETTLED_FOR_S = 5.0
"""For at least so long."""
MIN_STEADY_S = 15.0
"""Steady flight from which it can be told whether she is held; shorter, she may still be on her
way."""
MAX_SATURATED_FRACTION = 0.2
"""A surface that stands at its stops for this share of steady flight is no loop's any more, but a
limit cycle's."""
SATURATED_SHARE = 0.999
"""Of the travel."""
AT_DEPTH_M = 0.3
"""This near to the depth asked for she counts as dived, and from then on she must not show
herself."""


class Leg(NamedTuple):
    """One stretch of constant set-points under water."""

    heading_deg: float
    depth_m: float
    settled_s: float | None
    """After it began; None where the vehicle did not settle before it ended."""


class Steady(NamedTuple):
    """95 % of the error once settled, by the windows and definitions of
    ``sysid.monitor.tracking_metrics``."""

    heading_deg: float
    pitch_deg: float
    depth_m: float


class DiveMetrics(NamedTuple):
    steady: Steady | None
    """None where no leg outlasts its settling."""
    legs: tuple[Leg, ...]
    rudder_deg: float
    elevator_deg: float
    """The largest commands."""
    stopped: float
    """Share of the dive in which either was at its stop."""
    shallowest_m: float | None
    """Once dived, by the truth; None for a vehicle that never was."""
    broached: bool
    """Her hull came through the surface then."""
    diverged: str
    """What was not held; empty for a vehicle that flew."""
    failsafe: str
    """What ended the mission, without its figure."""
    seconds: float


def of_dive(dive: SimulatedDive, travel_rad: float, hull_radius_m: float) -> DiveMetrics:
    log = dive.log
    legs = tracking_metrics.tracking(log, settling_s=0.0)
    rudder, elevator = np.abs(log.actuators.rudder_rad), np.abs(log.actuators.elevator_rad)
    shallowest_m = _shallowest_m(dive)
    return DiveMetrics(
        steady=_steady(log),
        legs=tuple(_leg(log, window) for window in legs.windows) if legs else (),
        rudder_deg=math.degrees(float(np.max(rudder))),
        elevator_deg=math.degrees(float(np.max(elevator))),
        stopped=float(np.mean(np.maximum(rudder, elevator) > SATURATED_SHARE * travel_rad)),
        shallowest_m=shallowest_m,
        broached=shallowest_m is not None and shallowest_m < hull_radius_m,
        diverged=_divergence(dive, travel_rad),
        failsafe=re.sub(r" -?\d.*", "", dive.failsafe),
        seconds=dive.seconds,
    )


def _in_window(log: Log, window: SteadyWindow) -> NDArray[np.bool_]:
    """Samples of a window; a rehearsed log has one time for all of its records."""
    time_s = log.attitude.time_s
    return (time_s >= window.start_s) & (time_s < window.stop_s)


def _heading_error_rad(log: Log) -> Array:
    """From the set-point of the moment, which moves where a path is followed."""
    error = log.attitude.yaw_rad - log.setpoints.heading_rad
    return np.asarray((error + math.pi) % (2.0 * math.pi) - math.pi)


def _steady(log: Log) -> Steady | None:
    found = tracking_metrics.tracking(log)
    if found is None:
        return None
    settled = np.any([_in_window(log, window) for window in found.windows], axis=0)
    heading = tracking_metrics.spread(np.degrees(_heading_error_rad(log)[settled]))
    return Steady(heading.p95, found.pitch_deg.p95, found.depth_m.p95)


def _leg(log: Log, leg: SteadyWindow) -> Leg:
    off = np.abs(_heading_error_rad(log)) > SETTLED_RAD
    off |= np.abs(log.depth.depth_m - leg.depth_setpoint_m) > SETTLED_M
    late = log.attitude.time_s[off & _in_window(log, leg)]
    last_s = float(late[-1]) if late.size else leg.start_s
    settled = leg.stop_s - last_s >= SETTLED_FOR_S
    return Leg(
        leg.heading_setpoint_deg, leg.depth_setpoint_m, last_s - leg.start_s if settled else None
    )


def _shallowest_m(dive: SimulatedDive) -> float | None:
    """Least depth between reaching the first depth asked for and turning to the surface."""
    wanted_m = dive.log.setpoints.depth_m
    down = (np.abs(dive.true_depth_m - wanted_m) < AT_DEPTH_M) & (
        wanted_m > tracking_metrics.SUBMERGED_M
    )
    if not np.any(down):
        return None
    return float(np.min(dive.true_depth_m[int(np.argmax(down)) :]))


def _divergence(dive: SimulatedDive, travel_rad: float) -> str:
    """The first thing that was not held once it should have settled."""
    log = dive.log
    judged = tracking_metrics.tracking(log, shortest_s=MIN_STEADY_S)
    for window in judged.windows if judged else ():
        now = _in_window(log, window)
        rudder, elevator = (
            float(np.mean(np.abs(command[now]) > SATURATED_SHARE * travel_rad))
            for command in (log.actuators.rudder_rad, log.actuators.elevator_rad)
        )
        if (
            np.max(np.abs(_heading_error_rad(log)[now])) > HOLDING_LIMITS.heading_rad
            or rudder > MAX_SATURATED_FRACTION
        ):
            return "heading"
        if (
            window.pitch_deg.largest > math.degrees(HOLDING_LIMITS.pitch_rad)
            or elevator > MAX_SATURATED_FRACTION
        ):
            return "pitch"
        if window.depth_m.largest > HOLDING_LIMITS.down_m:
            return "depth"
    return "" if dive.finished or dive.failsafe else "the mission's time"
