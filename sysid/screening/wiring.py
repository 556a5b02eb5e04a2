"""Refusal of logs whose surfaces and planes, or angles and rates, do not belong together.

Each log is tested by itself, because outputs and sensors are set up once per dive. The control
effects leave out runs whose angles, rates and depth contradict each other: their own screening rule
names that cause.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from sysid.data import kinematics
from sysid.data.dataset import Log
from sysid.data.kinematics import AngleRateFit
from sysid.data.runs import Run
from sysid.planes import PLANES, Plane
from sysid.screening import preroll, rules
from sysid.screening.control_effect import ControlEffect, control_effect, static_gain

REVERSED_SIGNIFICANCE = 4.0
"""Standard deviations below zero from which on an effect is reversed."""
SWAPPED_SIGNIFICANCE, SWAPPED_SHARE = 6.0, 0.4
"""Significance and explained share of the other plane's rate from which on planes are swapped."""
MAX_OWN_SHARE = 0.2
"""Largest explained share of the tested plane's rate, and of its angle, if planes are swapped."""
MAX_RATIO, RATIO_SIGNIFICANCE = 2.5, 8.0
"""Ratio of the effects in two logs, and its significance, from which on the vehicles differ.

The estimate is linear and depends on size and shape of the tests: clean tests of one vehicle differ
by up to a factor of two.
"""
MAX_SIZE_RATIO = 2.0
"""Largest ratio of the median test sizes of two logs whose effects are compared."""
MIN_COMPARED_SHARE = 0.4
"""Smallest explained share of the rate from which on an effect is compared with that of another
log. Long steps of an unstable hull, which turns on whatever its rudder does, do not give it.
"""
MAX_START_SHARE = 0.25
"""Largest mean rate before a test, over the largest rate in it, of a test that is compared.

A vehicle that turns on and on has lost its speed, and responds little to its surfaces.
"""
MAX_UNIT_RATIO_ERROR = 2.0
"""Largest factor between the ratio of two effects and 57.3 at which a unit is named as cause."""
MAX_SCALE_ERROR = 0.1
"""Largest relative difference of the changes of an angle and of its integrated rate in a log.

A compass whose deviation changes by 5 deg in a turn of 90 deg has one of 6 %.
"""
MAX_LAG_DIFFERENCE_S = 0.12
"""Largest difference of the lags of heading and pitch in a log.

A fit has one lag for both angles; with 0.13 s between them its intervals are too wide for a
redesign.
"""
SENSOR_SIGNIFICANCE = 6.0
"""Standard deviations by which a log must exceed one of these two limits to be refused."""
HARDWARE_PARAMETERS = ("ACT_TRAVEL_DEG",)
"""Parameters that describe the vehicle and do not change between its dives."""


class LogOfRuns(NamedTuple):
    """Log with its tests, before screening."""

    log: Log
    runs: Sequence[Run]


def refusal(logs: Sequence[LogOfRuns]) -> str:
    """Return why the logs cannot be of one correctly wired vehicle.

    Parameters
    ----------
    logs : sequence of LogOfRuns
        All logs, fitted and held out.

    Returns
    -------
    str
        One line; empty if nothing contradicts.
    """
    return (
        next(filter(None, map(_miswired, logs)), "")
        or next(filter(None, map(_wrong_scale, logs)), "")
        or _different_lags(logs)
        or _different_hardware(logs)
        or _different_effects(logs)
    )


def _miswired(log: LogOfRuns) -> str:
    """Return the reason if planes are swapped or a sign is reversed in a log."""
    for plane, runs in _runs_by_plane(log.runs).items():
        own = control_effect(runs, plane, plane)
        if own is None:
            continue
        other = PLANES[plane].other
        moved, mover = control_effect(runs, other, plane), control_effect(runs, plane, other)
        gain = static_gain(runs, plane)
        if moved is not None and _is_swapped(own, gain, moved):
            return _swapped_reason(log.log.name, plane, plane, other, moved)
        if mover is not None and _is_swapped(own, gain, mover):
            return _swapped_reason(log.log.name, plane, other, plane, mover)
        if own.significance < -REVERSED_SIGNIFICANCE and (gain is None or gain.value < 0.0):
            return _reversed_reason(log.log.name, plane, own)
    return ""


def _runs_by_plane(runs: Iterable[Run]) -> Mapping[Plane, list[Run]]:
    """Return the runs of each plane whose measurements agree with each other.

    Runs that begin in a turn are left out if the plane has others.
    """
    consistent = [
        run
        for run in runs
        if not rules.attitude_rate_mismatch(run) and not rules.depth_pitch_mismatch(run)
    ]
    by_plane = {plane: [run for run in consistent if run.plane == plane] for plane in Plane}
    return {
        plane: [run for run in runs if not _begins_in_turn(run)] or runs
        for plane, runs in by_plane.items()
    }


def _begins_in_turn(run: Run) -> bool:
    """Return whether the vehicle turned before the test nearly as fast as in the test."""
    if not np.any(run.approach):
        return False
    before = max(abs(np.mean(run.in_plane(plane).rate_radps[run.approach])) for plane in Plane)
    return bool(before > MAX_START_SHARE * np.max(np.abs(run.rate_radps[run.under_test])))


def _is_swapped(own: ControlEffect, gain: ControlEffect | None, other: ControlEffect) -> bool:
    """Return whether another pair of surface and plane explains the tests of a surface.

    `own` and `gain` are the effect and the static gain of the surface in its own plane: a vehicle
    that keeps turning fast with its rudder hard over has little effect, but a gain.
    """
    return (
        abs(other.significance) >= SWAPPED_SIGNIFICANCE
        and other.share >= SWAPPED_SHARE
        and own.share <= MAX_OWN_SHARE
        and (gain is None or gain.value <= 0.0 or gain.share <= MAX_OWN_SHARE)
    )


def _swapped_reason(
    name: str, tested: Plane, surface: Plane, moved: Plane, effect: ControlEffect
) -> str:
    """Describe swapped planes: tests in which a surface moves a plane that is not its own."""
    return (
        f"{name}: swapped planes: in the {PLANES[tested].surface} tests the"
        f" {PLANES[surface].surface} output moves the {moved} rate ({effect.share:.0%} of its"
        f" change), and the {PLANES[tested].surface} output does not move the {tested} rate; give"
        " the outputs in the right order with --servo-channels"
    )


def _reversed_reason(name: str, plane: Plane, own: ControlEffect) -> str:
    """Describe a reversed sign."""
    surface = PLANES[plane].surface
    direction = "to port" if PLANES[plane].is_yaw else "down"
    return (
        f"{name}: reversed sign: a positive {surface} turns the nose {direction}"
        f" ({own.value:+.2g} +- {own.sd:.1g} 1/s2); give the {surface}'s output with a"
        " minus in --servo-channels, or its sensor the right sign"
    )


def _wrong_scale(log: LogOfRuns) -> str:
    """Return the reason if an angle changes by more or less than its integrated rate."""
    heading, pitch = _angle_fits(log.runs)
    for name, fit in (("heading", heading), ("pitch", pitch)):
        if fit and _is_beyond(fit.ratio - 1.0, fit.ratio_sd, MAX_SCALE_ERROR):
            return (
                f"{log.log.name}: the {name} changes by {fit.ratio:.2f} +- {fit.ratio_sd:.2f} times"
                f" the integral of its rate, allowed {1.0 - MAX_SCALE_ERROR:g} to"
                f" {1.0 + MAX_SCALE_ERROR:g}: one of them has a wrong scale"
            )
    return ""


def _different_lags(logs: Sequence[LogOfRuns]) -> str:
    """Return the reason if heading and pitch follow their rates with different lags."""
    heading, pitch = _angle_fits([run for log in logs for run in log.runs])
    if heading is None or pitch is None:
        return ""
    sd_s = math.hypot(heading.lag_sd_s, pitch.lag_sd_s)
    if not _is_beyond(heading.lag_s - pitch.lag_s, sd_s, MAX_LAG_DIFFERENCE_S):
        return ""
    return (
        f"the heading follows its rate {heading.lag_s:+.2f} s late, and the pitch"
        f" {pitch.lag_s:+.2f} s, at most {MAX_LAG_DIFFERENCE_S:g} s apart: correct the time stamps"
        " of one of them, or fit the logs of each plane by themselves"
    )


def _angle_fits(runs: Sequence[Run]) -> tuple[AngleRateFit | None, AngleRateFit | None]:
    """Return how heading and pitch follow their rates, each in the tests of its own plane.

    A run that contradicts itself is left out: its own screening rule names unit or sign.
    """
    consistent = [run for run in runs if not rules.attitude_rate_mismatch(run)]
    return (
        kinematics.fit_heading(run for run in consistent if run.plane == Plane.YAW),
        kinematics.fit_pitch(run for run in consistent if run.plane == Plane.PITCH),
    )


def _is_beyond(difference: float, sd: float, limit: float) -> bool:
    """Return whether a difference is surely above a limit."""
    return abs(difference) > max(limit, SENSOR_SIGNIFICANCE * sd)


def _different_hardware(logs: Sequence[LogOfRuns]) -> str:
    """Return the reason if a parameter that describes the vehicle differs between logs."""
    for name in HARDWARE_PARAMETERS:
        known = [log.log for log in logs if name in log.log.parameters]
        for one, other in combinations(known, 2):
            values = one.parameters[name], other.parameters[name]
            if not math.isclose(*values, rel_tol=1e-3):
                return (
                    f"{one.name} and {other.name}: two different vehicles: {name} ="
                    f" {values[0]:g} and {values[1]:g}; fit the logs of one vehicle"
                )
    return ""


def _different_effects(logs: Sequence[LogOfRuns]) -> str:
    """Return the reason if a surface is several times as effective in one log as in another."""
    runs_by_log = [(log.log.name, _runs_by_plane(log.runs)) for log in logs]
    for (name, runs), (other_name, other_runs) in combinations(runs_by_log, 2):
        for plane in Plane:
            explained = [_explained(runs[plane]), _explained(other_runs[plane])]
            if not _are_comparable(*explained):
                continue
            effects = [control_effect(part, plane, plane) for part in explained]
            if effects[0] and effects[1] and _differ(effects[0], effects[1]):
                return (
                    f"{name} and {other_name}: two different vehicles, or another speed: the"
                    f" {PLANES[plane].surface} gives {effects[0].value:.2g} +-"
                    f" {effects[0].sd:.1g} and {effects[1].value:.2g} +-"
                    f" {effects[1].sd:.1g} 1/s2; fit the logs of one vehicle"
                    f"{_unit_hint(effects[0].value / effects[1].value)}"
                )
    return ""


def _unit_hint(ratio: float) -> str:
    """Return the hint at radians in place of degrees, if the ratio of two effects is about 57."""
    error = abs(abs(math.log(ratio)) - math.log(math.degrees(1.0)))
    if error > math.log(MAX_UNIT_RATIO_ERROR):
        return ""
    return (
        f", or give both in the same units: a ratio of {max(ratio, 1.0 / ratio):.0f} is that of"
        " degrees to radians, about 57"
    )


def _explained(runs: Sequence[Run]) -> list[Run]:
    """Return the runs in which the surface explains enough of the rate to be compared.

    After an unstable hold the vehicle is in a turn, where the surface has another effect.
    """
    held = [run for run in runs if not preroll.is_at_stops(run)]
    effects = [(run, control_effect([run], run.plane, run.plane)) for run in held]
    return [run for run, effect in effects if effect and effect.share >= MIN_COMPARED_SHARE]


def _are_comparable(runs: Sequence[Run], others: Sequence[Run]) -> bool:
    """Return whether both logs have tests of the plane of similar size at the same thrust."""
    if not runs or not others:
        return False
    sizes, thrusts = (
        [sorted(value(run) for run in part)[len(part) // 2] for part in (runs, others)]
        for value in (lambda run: abs(run.magnitude_deg), lambda run: float(run.thrust[0]))
    )
    return max(sizes) <= MAX_SIZE_RATIO * min(sizes) and math.isclose(*thrusts, abs_tol=0.03)


def _differ(one: ControlEffect, other: ControlEffect) -> bool:
    """Return whether two effects differ by more than their uncertainty and the tests' influence."""
    small, large = sorted((one, other), key=lambda effect: effect.value)
    if small.value <= 0.0 or min(one.share, other.share) < MIN_COMPARED_SHARE:
        return False
    relative_sd = math.hypot(1.0 / small.significance, 1.0 / large.significance)
    log_ratio = math.log(large.value / small.value)
    return log_ratio > math.log(MAX_RATIO) and log_ratio > RATIO_SIGNIFICANCE * relative_sd
