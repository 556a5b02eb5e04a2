"""Cell: redesigned gains on a hundred vehicles with random errors of up to 20 % per coefficient.

All have the true vehicle's rudder bias of -6 degrees and 22 N of buoyancy, and use its trims.
"""

from functools import partial
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.redesign import holding
from benchmarks.redesign.campaign import OURS, SEA, VEHICLE, Values
from benchmarks.redesign.holding import DISTURBED, TrackingError
from benchmarks.study import Cell, Figure
from sitl import scenario
from sitl.vehicle import build_model, config
from sitl.vehicle.config import VehicleConfig, VehicleFileError

Array = NDArray[np.float64]

ASTRAY = 0.2
"""Largest relative error of each coefficient of the linear column, uniformly distributed."""
CASES = (VEHICLE,)
TWICE = TrackingError(*(2.0 * most for most in DISTURBED))


class Drawn(NamedTuple):
    """A sampled vehicle."""

    vehicle: VehicleConfig
    refused: int
    """Number of impossible vehicles that were drawn before it."""


def draw(name: str, seed: int) -> Drawn:
    """Return a supplied vehicle with an independent error in every coefficient."""
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
    """Return the number of rejected draws, then ``TrackingError``."""
    vehicle, refused = draw(case, seed)
    return [
        float(refused),
        *holding.tracking_error(holding.straight_run(values, scenario.load(SEA), seed, vehicle)),
    ]


def judge(case: str, rows: Array) -> list[Figure]:
    """Return the figures over all vehicles."""
    held = rows[:, 1:]
    outside = ~np.all(held[:, :3] <= np.array(TWICE[:3]), axis=1)
    return [
        Figure("rejected draws", float(np.sum(rows[:, 0]))),
        *holding.figures({OURS: held}, worst=TWICE),
        Figure("outside twice the targets", 100.0 * float(np.mean(outside)), highest=0.0, unit="%"),
    ]


def cell(gains: dict[str, Values]) -> Cell:
    """Return the cell of this study."""
    return Cell(
        "robust",
        "straight runs of vehicles that were not identified",
        partial(trial, gains[OURS]),
        judge,
        runs=100,
    )
