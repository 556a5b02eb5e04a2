"""Cell: our gains on a hundred vehicles whose every coefficient is off by up to a fifth.

All have the field vehicle's rudder bias of -6 degrees and 22 N of buoyancy, and all fly on her
trims."""

from functools import partial
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign import holding
from benchmarks.redesign.campaign import OURS, SEA, VEHICLE, Values
from benchmarks.redesign.holding import DISTURBED, Held
from benchmarks.study import Cell, Figure
from sitl import scenario
from sitl.vehicle import build_model, config
from sitl.vehicle.config import VehicleConfig, VehicleFileError

Array = NDArray[np.float64]

ASTRAY = 0.2
"""Of each coefficient of the linear column, uniformly either way."""
CASES = (VEHICLE,)
TWICE = Held(*(2.0 * most for most in DISTURBED))


class Drawn(NamedTuple):
    vehicle: VehicleConfig
    refused: int
    """Draws before it that no vehicle could be."""


def draw(name: str, seed: int) -> Drawn:
    """A shipped vehicle with every coefficient moved by itself."""
    first, rng, refused = config.load(name), np.random.default_rng(seed), 0
    while True:
        names = first.linear.__struct_fields__
        factors = dict(
            zip(names, rng.uniform(1.0 - ASTRAY, 1.0 + ASTRAY, len(names)).tolist(), strict=True)
        )
        moved = {name: getattr(first.linear, name) * factor for name, factor in factors.items()}
        vehicle = msgspec.structs.replace(
            first, linear=msgspec.structs.replace(first.linear, **moved)
        )
        try:
            build_model.build(vehicle)
        except VehicleFileError:
            refused += 1
        else:
            return Drawn(vehicle, refused)


def trial(values: Values, case: str, seed: int) -> list[float]:
    """Draws that were refused, then ``Held``."""
    vehicle, refused = draw(case, seed)
    return [
        float(refused),
        *holding.held(holding.straight_run(values, scenario.load(SEA), seed, vehicle)),
    ]


def judge(case: str, rows: Array) -> list[Figure]:
    held = rows[:, 1:]
    outside = ~np.all(held[:, :3] <= np.array(TWICE[:3]), axis=1)
    return [
        Figure("draws that could be no vehicle", float(np.sum(rows[:, 0]))),
        *holding.figures({OURS: held}, worst=TWICE),
        Figure("outside twice the targets", 100.0 * float(np.mean(outside)), highest=0.0, unit="%"),
    ]


def cell(gains: dict[str, Values]) -> Cell:
    return Cell(
        "robust",
        "a straight run of vehicles nobody identified",
        partial(trial, gains[OURS]),
        judge,
        runs=100,
    )
