"""Cell: straight runs with each set of gains, on the same seeds, in several seas."""

from functools import partial
from math import inf

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign import holding
from benchmarks.redesign.campaign import Values
from benchmarks.redesign.holding import ANYTHING, CALM, TrackingError
from benchmarks.study import Cell, Figure
from sitl import scenario
from sitl.environment_schema import CurrentConfig, Variation
from sitl.scenario import Scenario

Array = NDArray[np.float64]

SEAS = ("calm", "disturbed", "rough", "current", "swell")
TARGETS = {"calm": CALM, "disturbed": TrackingError(0.75, 4.5, 0.75, 0.0)}
"""Largest mean of the dives."""
WORST = {"calm": TrackingError(0.3, inf, inf, 0.0)}
"""Largest value of one dive."""
ROUGHER = 2.0
"""Ratio of the moments of the rough sea to those of the disturbed one."""
CURRENT = CurrentConfig(
    speed_mps=0.3, towards_deg=110.0, variation=Variation(rms_mps=0.1, time_constant_s=60.0)
)


def sea(name: str) -> Scenario:
    """Return a supplied scenario, or the disturbed one made rougher or with a variable current."""
    if name not in ("rough", "current"):
        return scenario.load(name)
    disturbed = scenario.load("disturbed")
    if name == "current":
        return msgspec.structs.replace(disturbed, current=CURRENT)
    slow, waves = (
        msgspec.structs.replace(
            part, yaw_rms_nm=ROUGHER * part.yaw_rms_nm, pitch_rms_nm=ROUGHER * part.pitch_rms_nm
        )
        for part in (disturbed.disturbance.slow, disturbed.disturbance.waves)
    )
    moments = msgspec.structs.replace(disturbed.disturbance, slow=slow, waves=waves)
    return msgspec.structs.replace(disturbed, disturbance=moments)


def trial(gains: dict[str, Values], case: str, seed: int) -> list[float]:
    """Return ``TrackingError`` of each set of gains in turn."""
    water = sea(case)
    return [
        number
        for values in gains.values()
        for number in holding.tracking_error(holding.straight_run(values, water, seed))
    ]


def judge(case: str, rows: Array) -> list[Figure]:
    """Return the figures of a sea."""
    return holding.figures(
        holding.by_set(rows), TARGETS.get(case, ANYTHING), WORST.get(case, ANYTHING)
    )


def cell(gains: dict[str, Values]) -> Cell:
    """Return the cell of this study."""
    return Cell(
        "steady", "straight runs in calm and rough water", partial(trial, gains), judge, runs=20
    )
