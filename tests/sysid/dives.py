"""Logs of simulated dives with several tests, for checks of whole logs."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from sitl.vehicle.config import VehicleConfig
from sysid.data.runs import RATE_HZ
from sysid.planes import PLANES, Plane
from tests.sysid import recording, sea
from tests.sysid.recording import Entry

Array = NDArray[np.float64]

REST_S = 40.0
"""Time with the loops closed after each test."""
START_S = 10.0
"""Vehicle time at which a log begins."""
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
    """Return the messages of a dive with tests, with REST_S of course keeping after each."""
    travel_rad = math.radians(vehicle.tailcone.travel_deg)
    log = _fly(vehicle, tests, seed, level, trim_rad, loop_on)
    log = log if change is None else change(log)
    messages: list[Entry] = []
    for k, row in enumerate(log):
        messages += _messages(START_S + k * sea.DT, row, travel_rad, vehicle, k % 5 == 0)
    if texts:
        for number, (test, begin_s) in enumerate(zip(tests, begins_s(tests), strict=True)):
            size_deg = math.degrees(float(np.max(np.abs(test.signal_rad))))
            axis = PLANES[test.announced or test.plane].sid_axis
            begin = f"SystemID Starting: axis={axis} wave=step magnitude={size_deg:.2f}"
            messages += recording.texts(begin_s, begin, 2 * number + 1)
            end_s = begin_s + test.signal_rad.size * sea.DT
            messages += recording.texts(end_s, "SystemID Finished", 2 * number + 2)
    return sorted(messages, key=lambda entry: entry[0])


def begins_s(tests: Sequence[DiveTest]) -> list[float]:
    """Return the vehicle times at which the tests begin."""
    lengths_s = [test.signal_rad.size * sea.DT + REST_S for test in tests]
    first_s = START_S + sea.PREROLL_S
    return [first_s + sum(lengths_s[:number]) for number in range(len(tests))]


def write(path: Path, vehicle: VehicleConfig, tests: Sequence[DiveTest], **options: object) -> Path:
    """Write a dive as MCAP; ``options`` are those of `entries`."""
    parameters = {"ACT_TRAVEL_DEG": vehicle.tailcone.travel_deg}
    return recording.write(path, entries(vehicle, tests, **options), parameters)  # type: ignore[arg-type]


def _fly(
    vehicle: VehicleConfig,
    tests: Sequence[DiveTest],
    seed: int,
    level: float,
    trim_rad: tuple[float, float],
    loop_on: bool,
) -> Array:
    """Return the measurements of a dive."""
    rest = np.full(int(REST_S * RATE_HZ), np.nan)
    signals: list[Array] = []
    for plane in Plane:
        parts = [
            part
            for test in tests
            for part in (
                test.signal_rad if test.plane == plane else np.full(test.signal_rad.size, np.nan),
                rest,
            )
        ]
        signals.append(np.concatenate(parts))
    closed = [np.full(signal.size, np.nan) for signal in signals]
    return sea.fly_tests(
        vehicle,
        sea.Tests(*(closed if loop_on else signals)),
        rng=np.random.default_rng(seed),
        level=level,
        trim_rad=trim_rad,
        added=sea.Tests(*map(np.nan_to_num, signals)) if loop_on else None,
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
