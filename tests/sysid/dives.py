"""Logs of simulated dives with several tests, for checks of whole logs."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from sitl.vehicle.config import VehicleConfig
from sysid.planes import PLANES, Plane
from tests.sysid import recording, sea
from tests.sysid.recording import Entry

Array = NDArray[np.float64]

APART_S = 100.0
"""Time from the beginning of one test with its pre-roll to that of the next."""
Change = Callable[[Array], Array]
"""Function that changes the measurements of ``sea.fly_tests``."""


class DiveTest(NamedTuple):
    """One test of a dive."""

    plane: Plane
    signal_rad: Array
    announced: Plane | None = None
    """Plane in the text, if it is another than that of the surface that moves."""


def entries(
    vehicle: VehicleConfig,
    tests: Sequence[DiveTest],
    *,
    seed: int = 0,
    level: float = sea.ROUGH,
    change: Change | None = None,
    texts: bool = True,
    trim_rad: tuple[float, float] = (math.radians(6.0), math.radians(1.0)),
    loop_on: bool = False,
) -> list[Entry]:
    """Return the messages of a dive with tests, APART_S from each other."""
    travel_rad = math.radians(vehicle.tailcone.travel_deg)
    messages: list[Entry] = []
    for number, test in enumerate(tests):
        log = _fly(vehicle, test, seed + number, level, trim_rad, loop_on)
        log = log if change is None else change(log)
        start_s = 10.0 + APART_S * number
        for k, row in enumerate(log):
            messages += _messages(start_s + k * sea.DT, row, travel_rad, vehicle, k % 5 == 0)
        if texts:
            begin_s = start_s + sea.PREROLL_S
            size_deg = math.degrees(float(np.max(np.abs(test.signal_rad))))
            axis = PLANES[test.announced or test.plane].sid_axis
            begin = f"SystemID Starting: axis={axis} wave=step magnitude={size_deg:.2f}"
            messages += recording.texts(begin_s, begin, 2 * number + 1)
            end_s = begin_s + test.signal_rad.size * sea.DT - 0.1
            messages += recording.texts(end_s, "SystemID Finished", 2 * number + 2)
    return sorted(messages, key=lambda entry: entry[0])


def write(path: Path, vehicle: VehicleConfig, tests: Sequence[DiveTest], **options: object) -> Path:
    """Write a dive as MCAP; ``options`` are those of `entries`."""
    parameters = {"ACT_TRAVEL_DEG": vehicle.tailcone.travel_deg}
    return recording.write(path, entries(vehicle, tests, **options), parameters)  # type: ignore[arg-type]


def _fly(
    vehicle: VehicleConfig,
    test: DiveTest,
    seed: int,
    level: float,
    trim_rad: tuple[float, float],
    loop_on: bool,
) -> Array:
    """Return the measurements of one test."""
    closed, none = np.full(test.signal_rad.size, np.nan), np.zeros(test.signal_rad.size)
    signals, added = [closed, closed], [none, none]
    (added if loop_on else signals)[PLANES[test.plane].index] = test.signal_rad
    return sea.fly_tests(
        vehicle,
        sea.Tests(*signals),
        rng=np.random.default_rng(seed),
        level=level,
        trim_rad=trim_rad,
        added=sea.Tests(*added) if loop_on else None,
    )


def _messages(
    time_s: float, row: Array, travel_rad: float, vehicle: VehicleConfig, with_depth: bool
) -> list[Entry]:
    """Return the messages of one tick."""
    ms, us = round(1e3 * time_s), round(1e6 * time_s)
    p, q, r, roll, pitch, yaw, depth, rudder, elevator = map(float, row)
    controls = [
        rudder / travel_rad,
        elevator / travel_rad,
        vehicle.operating_point.thrust_fraction,
        *[0.0] * 29,
    ]
    messages: list[Entry] = [
        (time_s, mavlink.MAVLink_attitude_message(ms, roll, pitch, yaw, p, q, r)),
        (time_s, mavlink.MAVLink_actuator_output_status_message(us, 7, controls)),
    ]
    if with_depth:
        position = mavlink.MAVLink_local_position_ned_message(ms, 0, 0, depth, 1.3, 0, 0.0)
        messages.append((time_s, position))
    return messages
