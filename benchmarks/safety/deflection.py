"""Time at full deflection that a sensor fault commands, beside the same dive without the fault.

The dives are straight and level when the fault begins, so that only the fault asks for deflection.
Full deflection that returns a vehicle from a wrong attitude to the straight and level one is not
counted: the true motion asks for it.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.safety import cases, flight
from benchmarks.safety.cases import Case, Leg
from mavlink_io.frames import euler_from_quaternion
from sitl.core import plant, timestep

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
ASTRAY_RAD = math.radians(10.0)
"""True difference of heading or pitch from the straight and level dive, from which full deflection
back is right."""
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
    """Whether rudder and elevator are at full travel, and not to return the vehicle; shape
    (ticks, 2)."""
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
    return timestep.TICK_S * max(_longest_run(surface) for surface in full.T)


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
    for tick in range(round(END_S / timestep.TICK_S)):
        frame, events = flight.step_pilot(pilot, flight.inputs_of(reading, 0.0), config)
        if tick == flight.BEGIN_TICK:
            flight.begin(case, pilot, config)
        if events or tick <= flight.BEGIN_TICK:
            mode = pilot.state.mode
        rudder, elevator = frame.controls[:2]
        _, pitch_rad, heading_rad = euler_from_quaternion(*body.truth.attitude_q)
        full.append((_leads_astray(rudder, heading_rad), _leads_astray(elevator, pitch_rad)))
        history.append(mode)
        body, reading = plant.step(sea.parts, body, frame, sea.rng)
        if tick > flight.BEGIN_TICK and not pilot.armed:
            break
    return CommandHistory(np.array(full), np.array(history))


def _leads_astray(command: float, angle_rad: float) -> bool:
    """Return whether a command is full and does not return the vehicle from an angle to zero."""
    returns = math.copysign(1.0, command) * angle_rad < -ASTRAY_RAD
    return abs(command) >= FULL and not returns


def _longest_run(flags: NDArray[np.bool_]) -> int:
    """Return the largest number of consecutive true flags."""
    longest = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        longest = max(longest, run)
    return longest
