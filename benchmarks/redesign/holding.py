"""Tracking errors of a straight run, from the true motion: 95 % values, and whether it was lost."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign.campaign import GAIN_SETS, OURS, VEHICLE, Values
from benchmarks.study import Figure
from ground.missions import script
from sitl.scenario import Scenario
from sitl.vehicle.config import VehicleConfig
from tests.helpers.closed_loop import Dive

Array = NDArray[np.float64]

MISSION, HEADING_DEG, DEPTH_M = "straight_run", 20.0, 3.0
STEADY_S = 60.0
"""Start of the steady part: dived, turned, and integrators settled."""
LOST_DEG, LOST_M = 30.0, 2.0
"""Errors beyond which the loop is taken to have diverged."""


class TrackingError(NamedTuple):
    """Limits that 95 % of the absolute errors in a window do not exceed."""

    heading_deg: float
    depth_cm: float
    pitch_deg: float
    """Relative to the mean pitch, because level flight has a pitch that is not zero."""
    lost: float
    """1.0 for a dive that diverged or that a failsafe ended."""


WHAT, UNITS = ("heading", "depth", "pitch about trim"), ("deg", "cm", "deg")
CALM, DISTURBED = TrackingError(0.3, 2.0, 0.3, 0.0), TrackingError(1.1, 7.0, 1.4, 0.0)
"""Targets."""
ANYTHING = TrackingError(np.inf, np.inf, np.inf, np.inf)


def straight_run(
    values: Values, sea: Scenario, seed: int, vehicle: str | VehicleConfig = VEHICLE
) -> Dive:
    """Simulate the mission of a straight run."""
    items = script.compile_items(script.load(MISSION))
    return Dive(items, vehicle=vehicle, sea=sea, seed=seed, values=values)


def tracking_error(dive: Dive, start_s: float = STEADY_S) -> TrackingError:
    """Return the errors of a straight run from ``start_s`` until the vehicle surfaces."""
    end_s = min(dive.surfacing_s, dive["t_s"][-1])
    window = dive.during(start_s, end_s)
    if not window.any():
        return TrackingError(np.nan, np.nan, np.nan, 1.0)
    pitch_deg = np.degrees(dive["true_pitch"][window])
    heading_deg = np.degrees(wrap_angle(dive["true_heading"][window] - np.radians(HEADING_DEG)))
    depth_m = dive["true_depth_m"][window] - DEPTH_M
    lost = (
        bool(dive.state.failsafe)
        or np.abs(heading_deg).max() > LOST_DEG
        or np.abs(depth_m).max() > LOST_M
    )
    return TrackingError(
        p95(heading_deg), 100.0 * p95(depth_m), p95(pitch_deg - pitch_deg.mean()), float(lost)
    )


def wrap_angle(angle_rad: Array) -> Array:
    """Wrap angles to [-pi, pi)."""
    return np.asarray((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)


def p95(error: Array) -> float:
    """Return the 95 % quantile of the absolute error."""
    return float(np.quantile(np.abs(error), 0.95))


def by_set(rows: Array) -> dict[str, Array]:
    """Split (dives, gain sets x TrackingError) into (dives, TrackingError) per gain set."""
    return dict(zip(GAIN_SETS, np.split(rows, len(GAIN_SETS), axis=1), strict=True))


def figures(
    held: dict[str, Array], target: TrackingError = ANYTHING, worst: TrackingError = ANYTHING
) -> list[Figure]:
    """Return mean and worst dive of each set of gains; only our gains have targets."""
    found = []
    for column, (what, unit) in enumerate(zip(WHAT, UNITS, strict=True)):
        for name, rows in held.items():
            mean, most = float(np.nanmean(rows[:, column])), float(np.nanmax(rows[:, column]))
            limit, last = (target[column], worst[column]) if name == OURS else (np.inf, np.inf)
            found += [
                Figure(f"{what}, 95 %: {name}", mean, highest=limit, unit=unit),
                Figure(f"{what}, 95 %: {name}, worst dive", most, highest=last, unit=unit),
            ]
    return [*found, *(_lost(name, rows) for name, rows in held.items())]


def _lost(name: str, rows: Array) -> Figure:
    """Return the share of dives that lost the vehicle, in percent."""
    return Figure(
        f"lost: {name}",
        100.0 * float(np.mean(rows[:, -1])),
        highest=0.0 if name == OURS else np.inf,
        unit="%",
    )
