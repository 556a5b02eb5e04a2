"""Cell: overshoot of a change of depth by 3 m, from the true depth."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign.campaign import GAIN_SETS, OURS, VEHICLE, Values
from benchmarks.study import Cell, Figure
from ground.missions import script
from tests.helpers.closed_loop import Dive

Array = NDArray[np.float64]

CASES = ("calm", "disturbed")
MISSION, START_S, END_S = "depth_change", 70.0, 130.0
"""Mission, and the leg at its second depth."""
FROM_M, TO_M = 2.0, 5.0
"""Depth set-points before and during that leg."""
MAX_OVERSHOOT_PCT = 4.0
"""Target."""


def trial(gains: dict[str, Values], case: str, seed: int) -> list[float]:
    """Return the overshoot (%) of each set of gains in turn."""
    items = script.compile_items(script.load(MISSION))
    dives = (
        Dive(items, vehicle=VEHICLE, sea=case, seed=seed, values=values)
        for values in gains.values()
    )
    return [overshoot_pct(dive) for dive in dives]


def overshoot_pct(dive: Dive) -> float:
    """Return the largest depth beyond the new set-point, in percent of the change."""
    leg = dive.during(START_S, END_S)
    beyond_m = float(np.max(dive["true_depth_m"][leg], initial=-np.inf)) - TO_M
    return 100.0 * max(0.0, beyond_m) / (TO_M - FROM_M)


def judge(case: str, rows: Array) -> list[Figure]:
    """Return mean and worst overshoot of each set of gains; only our gains have a target."""
    found = []
    for name, column in zip(GAIN_SETS, rows.T, strict=True):
        limit = MAX_OVERSHOOT_PCT if name == OURS else np.inf
        found += [
            Figure(f"overshoot: {name}", float(np.mean(column)), highest=limit, unit="%"),
            Figure(f"overshoot: {name}, worst dive", float(np.max(column)), unit="%"),
        ]
    return found


def cell(gains: dict[str, Values]) -> Cell:
    """Return the cell of this study."""
    return Cell("changes", "a change of depth by 3 m", partial(trial, gains), judge, runs=20)
