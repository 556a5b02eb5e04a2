"""Time at full deflection that a sensor fault commands, beside the same dive without the fault.

The dives are straight and level when the fault begins, so that only the fault asks for deflection.
Full deflection that returns the vehicle from an attitude that the fault has led it to counts too.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.safety import cases, flight
from benchmarks.safety.cases import Case, Leg
from mavlink_io.tick import TICK_S
from sitl.core import plant

SENSORS = (
    "gyro",
    "accelerometer",
    "magnetometer",
    "pressure",
    "gps",
    "dvl",
    "altimeter",
    "battery",
    "encoder",
    "leak",
)
"""Units of the catalogue that measure."""
MAX_FULL_S = 0.5
"""Longest time at full travel that a single sensor may command."""
FULL = 0.99
"""Fraction of the travel that counts as full."""
LEGS = (Leg(4.0, 0.0, 130.0),)
"""Mission: straight and level."""
DELAY_S = 35.0
"""Time by which the fault begins later than in the dive of ``cases.single_fault``: the vehicle has
reached its depth."""
END_S = 130.0
"""Vehicle time at which the dives end; the latest fault begins at 115 s."""


class CommandHistory(NamedTuple):
    """Commands of a dive."""

    full: NDArray[np.bool_]
    """Whether rudder and elevator are at full travel; shape (ticks, 2)."""
    mode: NDArray[np.int64]
    """Mode of each tick."""


def sensor_faults() -> list[tuple[str, str]]:
    """Return unit and kind of every fault of a sensor."""
    return [name for name in cases.catalogue_names() if name[0] in SENSORS]


def sensor_dive(unit: str, kind: str, vehicle: str, seed: int) -> Case:
    """Return the straight dive of a fault; size and start are drawn from the seed."""
    case = cases.single_fault(unit, kind, vehicle, seed)
    (row,) = case.faults
    return case._replace(faults=({**row, "at_s": float(row["at_s"]) + DELAY_S},), legs=LEGS)


def longest_full_s(case: Case) -> float:
    """Return the longest time that rudder or elevator are at full travel because of the fault.

    Ticks in another mode than the undisturbed dive do not count: a failsafe commands them. Nor do
    ticks at full travel of the undisturbed dive.

    Parameters
    ----------
    case : Case
        Dive of ``sensor_dive``.
    """
    flown, healthy = fly_commands(case), fly_undisturbed(case.vehicle, case.seed)
    count = min(len(flown.mode), len(healthy.mode))
    same_mode = flown.mode[:count] == healthy.mode[:count]
    full = flown.full[:count] & ~healthy.full[:count] & same_mode[:, None]
    return TICK_S * max(_longest_run(surface) for surface in full.T)


@lru_cache
def fly_undisturbed(vehicle: str, seed: int) -> CommandHistory:
    """Return the commands of the dive of ``sensor_dive`` without its fault."""
    return fly_commands(Case("undisturbed", vehicle, seed, legs=LEGS))


def fly_commands(case: Case) -> CommandHistory:
    """Fly a dive until it ends and return its commands."""
    config, sea = flight.configuration(case), flight.build(case)
    body, reading = plant.initial_state(sea.parts, sea.rng)
    pilot, mode = flight.new_pilot(), 0
    full, history = list[tuple[bool, bool]](), list[int]()
    for tick in range(round(END_S / TICK_S)):
        frame, events = flight.step_pilot(pilot, flight.inputs_of(reading, 0.0), config)
        if tick == flight.BEGIN_TICK:
            flight.begin(case, pilot, config)
        if events or tick <= flight.BEGIN_TICK:
            mode = pilot.state.mode
        rudder, elevator = frame.controls[:2]
        full.append((abs(rudder) >= FULL, abs(elevator) >= FULL))
        history.append(mode)
        body, reading = plant.step(sea.parts, body, frame, sea.rng)
        if tick > flight.BEGIN_TICK and not pilot.armed:
            break
    return CommandHistory(np.array(full), np.array(history))


def _longest_run(flags: NDArray[np.bool_]) -> int:
    """Return the largest number of consecutive true flags."""
    longest = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        longest = max(longest, run)
    return longest
