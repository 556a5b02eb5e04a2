"""Cases of the safety benchmark: vehicle, mission, sea, faults and parameters of one dive.

Every case is drawn from its seed alone, so that its number reproduces it.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from autopilot.control.params import MIN_WHEN_ON, PARAMETERS, ParamInfo
from mavlink_io.errors import InputError
from sitl.faults.catalogue import CATALOGUE, Size
from sitl.vehicle import build_model
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig

VEHICLES = vehicle_files.SHIPPED
FLOOR_M = 16.0
"""Depth of the floor under a dive with faults."""
DEEP_FLOOR_M = 60.0
"""Depth of the floor under a dive with changed parameters: below every depth limit."""
EARLIEST_S, LATEST_S = 5.0, 80.0
"""Limits of the start of a fault."""
RELATIVE = (0.2, 2.0)
"""Factors on a default size, for sizes that have no natural range."""
MAX_BALLAST_SHARE = 0.02
"""Largest ballast fault as a fraction of the vehicle's mass."""

HOLD_S = 600.0
"""FS_TIME_S of the dives with changed parameters: some missions end in HOLD, which has no end."""

FaultRow = dict[str, float | str]


class Leg(NamedTuple):
    """One leg of a mission."""

    depth_m: float
    heading_deg: float
    duration_s: float
    thrust_pct: float = 0.0
    """0: cruise thrust."""


class Case(NamedTuple):
    """One dive."""

    name: str
    vehicle: str
    seed: int
    faults: tuple[FaultRow, ...] = ()
    values: tuple[tuple[str, float], ...] = ()
    """Parameters that replace those of the vehicle."""
    legs: tuple[Leg, ...] = ()
    sea: tuple[float, float, float] = (1.0, 0.0, 0.0)
    """Factor on the disturbance moments, current (m/s) and significant wave height (m)."""
    floor_m: float = FLOOR_M
    link_loss: float = 0.0
    """Fraction of the ground station's heartbeats that is lost."""


SHORT_LEGS = (Leg(4.0, 0.0, 25.0), Leg(8.0, 60.0, 35.0), Leg(3.0, -40.0, 30.0))
"""Mission of the dives with faults: a descent, a turn and an ascent."""


def find_case(name: str, vehicle: str, seed: int) -> Case:
    """Return the dive of a name.

    Raises InputError.
    """
    kind, _, rest = name.partition(":")
    try:
        if kind == "fault":
            unit, fault = rest.split("-")
            return single_fault(unit, fault, vehicle, seed)
        if kind == "pair":
            return pair(int(rest))
        if kind == "mission":
            return random_mission(int(rest))
        return next(case for case in parameter_dives(vehicle) if case.name == name)
    except (ValueError, StopIteration):
        raise InputError(
            f"dive {name!r}: expected fault:UNIT-KIND, pair:N, mission:N or parameter:NAME=VALUE"
        ) from None


def command(case: Case) -> str:
    """Return the command that flies a dive again."""
    kind = case.name.partition(":")[0]
    options = f" --vehicle {case.vehicle}" if kind in ("fault", "parameter") else ""
    return f"python -m benchmarks.safety {case.name}{options}" + (
        f" --seed {case.seed}" if kind == "fault" else ""
    )


def catalogue_names() -> list[tuple[str, str]]:
    """Return unit and kind of every fault."""
    return [(unit, kind) for unit, kinds in CATALOGUE.items() for kind in kinds]


def single_fault(unit: str, kind: str, vehicle: str, seed: int) -> Case:
    """Return the dive of a fault; its sizes and its start are drawn from the seed."""
    number = catalogue_names().index((unit, kind))
    rng = np.random.default_rng((1, seed, number, VEHICLES.index(vehicle)))
    row = draw_fault(unit, kind, vehicle, rng, *RELATIVE)
    return Case(f"fault:{unit}-{kind}", vehicle, seed, (row,), legs=SHORT_LEGS)


def pair(number: int) -> Case:
    """Return the dive of a pair of faults of different units."""
    rng, names = np.random.default_rng((2, number)), catalogue_names()
    vehicle = VEHICLES[int(rng.integers(len(VEHICLES)))]
    first = names[int(rng.integers(len(names)))]
    others = [name for name in names if name[0] != first[0]]
    second = others[int(rng.integers(len(others)))]
    rows = tuple(draw_fault(*name, vehicle, rng, 0.05, 20.0) for name in (first, second))
    return Case(f"pair:{number}", vehicle, number, rows, legs=SHORT_LEGS)


def parameter_dives(vehicle: str = VEHICLES[0]) -> list[Case]:
    """Return one dive for each parameter at its lowest, least useful and highest value."""
    return [
        Case(
            f"parameter:{row.name}={value:.9g}",
            vehicle,
            1,
            values=(("FS_TIME_S", HOLD_S), (row.name, value)),
            legs=SHORT_LEGS,
            floor_m=DEEP_FLOOR_M,
        )
        for row in PARAMETERS
        for value in extreme_values(row)
    ]


def extreme_values(row: ParamInfo) -> list[float]:
    """Return the minimum, the least value that is not off, and the maximum of a parameter."""
    least = row.smallest if row.minimum <= 0.0 and row.name in MIN_WHEN_ON else row.minimum
    return sorted({row.minimum, least, row.maximum})


def random_mission(number: int) -> Case:
    """Return a random mission: 1 to 5 legs, a random sea, 0 to 2 faults, 0 to 30 % link loss."""
    rng, names = np.random.default_rng((3, number)), catalogue_names()
    vehicle = VEHICLES[int(rng.integers(len(VEHICLES)))]
    legs = tuple(
        Leg(
            float(rng.uniform(1.0, 10.0)),
            float(rng.uniform(-180.0, 180.0)),
            float(rng.uniform(15.0, 60.0)),
            float(rng.choice((0.0, rng.uniform(45.0, 90.0)))),
        )
        for _ in range(int(rng.integers(1, 6)))
    )
    sea = float(rng.uniform(0.0, 2.0)), float(rng.uniform(0.0, 0.4)), float(rng.uniform(0.0, 1.0))
    faults = tuple(
        draw_fault(*names[int(rng.integers(len(names)))], vehicle, rng, *RELATIVE)
        for _ in range(int(rng.integers(3)))
    )
    values = (
        ("FS_GCS_TIMEOUT", float(rng.choice((0.0, 3.0, 10.0)))),
        ("FS_GCS_ACT", float(rng.integers(3))),
        ("MIS_END_ACT", 1.0),
    )
    link_loss = float(rng.uniform(0.0, 0.3))
    return Case(
        name=f"mission:{number}",
        vehicle=vehicle,
        seed=number,
        faults=faults,
        values=values,
        legs=legs,
        sea=sea,
        link_loss=link_loss,
    )


def draw_fault(
    unit: str, kind: str, vehicle: str, rng: Generator, least: float, most: float
) -> FaultRow:
    """Return a fault with random start and sizes, as a row of a scenario file."""
    config = vehicle_config(vehicle)
    row: FaultRow = {
        "unit": unit,
        "kind": kind,
        "at_s": round(float(rng.uniform(EARLIEST_S, LATEST_S)), 2),
    }
    for size in CATALOGUE[unit][kind]:
        row[size.key] = _draw_size(
            size,
            rng,
            (least, most),
            travel_deg=config.tailcone.travel_deg,
            mass_kg=config.ballast.mass_kg,
            length_m=build_length_m(vehicle),
        )
    return row


def _draw_size(
    size: Size,
    rng: Generator,
    factors: tuple[float, float],
    *,
    travel_deg: float,
    mass_kg: float,
    length_m: float,
) -> float:
    """Return a random size in the unit of its key."""
    if size.key == "angle_deg":
        return float(rng.uniform(-travel_deg, travel_deg))
    if size.key == "share":
        return float(rng.uniform(0.02, 0.98))
    if size.key == "mass_kg":
        return float(rng.uniform(-1.0, 1.0)) * MAX_BALLAST_SHARE * mass_kg
    if size.key == "x_m":
        return float(rng.uniform(-0.35, 0.35)) * length_m
    if size.key in ("y_m", "z_m"):
        return float(rng.uniform(-0.02, 0.02)) * length_m
    low, high = (math.log(factor) for factor in factors)
    value = (size.default or 0.0) * math.exp(float(rng.uniform(low, high)))
    if size.minimum < 0.0 and rng.random() < 0.5:
        value = -value
    return min(size.maximum, max(size.minimum, value))


@cache
def vehicle_config(vehicle: str) -> VehicleConfig:
    """Return the content of a vehicle file."""
    return vehicle_files.load(vehicle)


@cache
def build_length_m(vehicle: str) -> float:
    """Return the length of a vehicle's hull."""
    return 2.0 * build_model.build(vehicle_config(vehicle)).hydrostatics.half_length_m
