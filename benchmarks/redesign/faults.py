"""Cell: straight runs with a fault that a dive may survive, with each set of gains."""

from functools import partial

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign import holding
from benchmarks.redesign.campaign import SEA, Values
from benchmarks.study import Cell, Figure
from sitl import scenario
from sitl.scenario import Scenario

Array = NDArray[np.float64]

FROM_S, SETTLED_S = 100.0, 130.0
"""Start of the fault, and start of the evaluated part."""
FAULTS: dict[str, dict[str, float]] = {
    "rudder slow": {"rate_degps": 0.5},
    "elevator slow": {"rate_degps": 0.5},
    "rudder slipping": {"share": 0.1},
    "elevator slipping": {"share": 0.1},
    "rudder biased": {"angle_deg": 3.0},
    "elevator biased": {"angle_deg": 2.0},
    "propeller loss": {"share": 0.3},
    "ballast added": {"mass_kg": 1.0},
    "ballast shifted": {"mass_kg": 3.0, "x_m": 0.5},
    "gyro off": {},
    "magnetometer off": {},
    "dvl off": {},
    "pressure slow": {"period_s": 1.0},
}


def sea(fault: str) -> Scenario:
    """Return the disturbed sea with a permanent fault, given as "unit kind"."""
    unit, kind = fault.split()
    row = {"unit": unit, "kind": kind, "at_s": FROM_S, **FAULTS[fault]}
    return msgspec.structs.replace(scenario.load(SEA), fault=(row,))


def trial(gains: dict[str, Values], case: str, seed: int) -> list[float]:
    """Return ``TrackingError`` of each set of gains after the effect of the fault."""
    water = sea(case)
    dives = [holding.straight_run(values, water, seed) for values in gains.values()]
    return [number for dive in dives for number in holding.tracking_error(dive, SETTLED_S)]


def judge(case: str, rows: Array) -> list[Figure]:
    """Return the figures of a fault."""
    return holding.figures(holding.by_set(rows))


def cell(gains: dict[str, Values]) -> Cell:
    """Return the cell of this study."""
    return Cell("faults", "straight runs with a fault", partial(trial, gains), judge, runs=5)
