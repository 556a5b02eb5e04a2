"""Cell: a straight run held by each set of gains, on the same seeds, in one sea after the other."""

from functools import partial

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign import holding
from benchmarks.redesign.campaign import Values
from benchmarks.redesign.holding import ANYTHING, CALM, DISTURBED
from benchmarks.study import Cell, Figure
from sitl import scenario
from sitl.environment_schema import Current, Variation
from sitl.scenario import Scenario

Array = NDArray[np.float64]

SEAS = ("calm", "disturbed", "rough", "current", "swell")
TARGETS = {"calm": CALM, "disturbed": DISTURBED}
ROUGHER = 2.0
"""Moments of the rough sea over those of the disturbed one."""
CURRENT = Current(
    speed_mps=0.3, towards_deg=110.0, variation=Variation(rms_mps=0.1, time_constant_s=60.0)
)


def sea(name: str) -> Scenario:
    """A shipped scenario, or the disturbed one made rough or with a current across the course that
    comes and goes."""
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
    """``Held`` of each set of gains in turn."""
    water = sea(case)
    return [
        number
        for values in gains.values()
        for number in holding.held(holding.straight_run(values, water, seed))
    ]


def judge(case: str, rows: Array) -> list[Figure]:
    return holding.figures(holding.by_set(rows), TARGETS.get(case, ANYTHING))


def cell(gains: dict[str, Values]) -> Cell:
    return Cell(
        "steady", "a straight run in calm and in rough water", partial(trial, gains), judge, runs=20
    )
