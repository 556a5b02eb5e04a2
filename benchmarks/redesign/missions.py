"""Cell: the missions of the paper's figures 14 and 15: settling of each leg, and submergence.

Depth is measured from the instantaneous surface above the vehicle: near the surface waves move the
vehicle with the water. The pressure sensor does not measure this motion, and it needs no control.
"""

from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign import holding
from benchmarks.redesign.campaign import GAIN_SETS, OURS, VEHICLE, Values
from benchmarks.redesign.holding import CALM, DISTURBED
from benchmarks.study import Cell, Figure
from ground.missions import script
from ground.missions.script import MissionStep
from sitl.vehicle import config, hull
from tests.helpers.closed_loop import Dive

Array = NDArray[np.float64]

CASES = ("combined/calm", "combined/disturbed", "shallow_1m/disturbed", "shallow_1m/swell")
END_S = 5.0
"""Length of the evaluated end of a leg."""
UNDER_M = 0.3
"""Water above the vehicle from which it counts as submerged."""
LEAST_WATER_M = 0.1
"""Least water above the vehicle that is required after that."""
TWICE = 2.0
"""A leg has settled if 95 % of errors are within this multiple of `CALM` or `DISTURBED`."""
STATIONS = 41


def trial(gains: dict[str, Values], case: str, seed: int) -> list[float]:
    """Return heading (deg) and depth errors (cm) per leg, and least water above the vehicle (m)."""
    mission, sea = case.split("/")
    steps = script.load(mission)
    row = []
    for values in gains.values():
        dive = Dive(script.compile_items(steps), vehicle=VEHICLE, sea=sea, seed=seed, values=values)
        row += [number for leg in _legs(steps.step) for number in _at_its_end(dive, *leg)]
        row.append(water_above_m(dive))
    return row


def _legs(steps: tuple[MissionStep, ...]) -> list[tuple[MissionStep, float]]:
    """Return the legs and their end times; each leg has a heading and a depth."""
    legs = [step for step in steps if step.duration_s]
    return list(zip(legs, np.cumsum([leg.duration_s for leg in legs]).tolist(), strict=True))


def _at_its_end(dive: Dive, leg: MissionStep, end_s: float) -> tuple[float, float]:
    """Return the 95 % errors of heading (deg) and depth (cm) at the end of a leg."""
    assert leg.heading_deg is not None
    assert leg.depth_m is not None
    window = dive.during(end_s - END_S, end_s)
    if not window.any():
        return np.inf, np.inf
    heading_rad = holding.wrap_angle(dive["true_heading"][window] - np.radians(leg.heading_deg))
    depth_m = dive["true_depth_m"][window] + dive["surface_m"][window]
    return holding.p95(np.degrees(heading_rad)), 100.0 * holding.p95(depth_m - leg.depth_m)


def water_above_m(dive: Dive) -> float:
    """Return the least depth of water above hull and duct, between submerging and surfacing."""
    pitch, depth_m = dive["true_pitch"], dive["true_depth_m"]
    x_m, radius_m = outline_m(VEHICLE)
    highest_m = np.max(np.outer(np.sin(pitch), x_m) + np.outer(np.cos(pitch), radius_m), axis=1)
    over_m = depth_m + dive["surface_m"] - highest_m
    return float(
        np.min(
            over_m[(np.cumsum(over_m > UNDER_M) > 0) & (dive["t_s"] < dive.surfacing_s)],
            initial=np.inf,
        )
    )


def outline_m(vehicle: str) -> tuple[Array, Array]:
    """Return stations along the hull (m forward of mid-length) and radii; the duct comes last."""
    described = config.load(vehicle)
    half = hull.length_m(described.hull) / 2.0
    x_m = np.linspace(-half, half, STATIONS)
    radius_m = hull.radius_m(described.hull, x_m)
    if described.duct is None:
        return x_m, radius_m
    return np.append(x_m, described.duct.x_m), np.append(radius_m, described.duct.diameter_m / 2.0)


def judge(case: str, rows: Array) -> list[Figure]:
    """Return errors per leg, settled fraction and least water above the vehicle."""
    target = CALM if case.endswith("calm") else DISTURBED
    most = TWICE * target.heading_deg, TWICE * target.depth_cm
    by_set = dict(zip(GAIN_SETS, np.split(rows, len(GAIN_SETS), axis=1), strict=True))
    legs = (rows.shape[1] // len(GAIN_SETS) - 1) // 2
    found = []
    for column, (leg, (what, unit)) in enumerate(
        product(range(1, legs + 1), (("heading", "deg"), ("depth", "cm")))
    ):
        for name, mine in by_set.items():
            limit = most[column % 2] if name == OURS else np.inf
            figure = Figure(
                f"leg {leg}, {what}, 95 %: {name}", float(np.mean(mine[:, column])), unit=unit
            )
            found.append(figure._replace(highest=limit))
    for name, mine in by_set.items():
        share = 100.0 * float(np.mean(np.all(mine[:, :-1] <= np.tile(most, legs), axis=1)))
        lowest = 100.0 if name == OURS else -np.inf
        found.append(Figure(f"every leg settled: {name}", share, lowest=lowest, unit="%"))
    for name, mine in by_set.items():
        least = LEAST_WATER_M if name == OURS else -np.inf
        found.append(
            Figure(
                f"least water above hull: {name}",
                float(np.min(mine[:, -1])),
                lowest=least,
                unit="m",
            )
        )
    return found


def cell(gains: dict[str, Values]) -> Cell:
    """Return the cell of this study."""
    return Cell("missions", "figures 14 and 15 of the paper", partial(trial, gains), judge, runs=20)
