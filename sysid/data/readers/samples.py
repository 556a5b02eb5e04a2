"""What every reader does with time stamps and numbers."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import (
    Actuators,
    Array,
    Attitude,
    Clock,
    ClockStep,
    Depth,
    DuctAngles,
    Log,
    Setpoints,
    TextEvent,
)

DEFAULT_TRAVEL_DEG = 15.0
"""Duct travel that an output of 1 stands for, unless the log's parameters say otherwise
(ACT_TRAVEL_DEG)."""
CLOCK_STEP_SAMPLES = 5
"""So many samples in a row that are older than one before are no longer late datagrams: the clock
went back."""
MAX_TIME_DIFFERENCE_S = 0.1
"""A sample further than this from those of another stream has no partner there."""


class MessageColumns(NamedTuple):
    """Every message of one name. Columns have the length of ``time_s``; text is bytes."""

    time_s: Array
    columns: Mapping[str, NDArray[Any]]


def strictly_increasing(time_s: Array) -> NDArray[np.bool_]:
    """Samples that are later than every one before: repeated and reordered ones are left out."""
    latest = np.maximum.accumulate(time_s)
    return np.concatenate(([True], time_s[1:] > latest[:-1]))[: time_s.size]


def clock_steps(what: str, time_s: Array) -> list[ClockStep]:
    """Where a clock went back for good, as it does when an autopilot starts anew."""
    stale = ~strictly_increasing(time_s)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], stale.astype(np.int8), [0]))))
    latest = np.maximum.accumulate(time_s)
    return [
        ClockStep(what, float(latest[first]), float(latest[first] - time_s[first]))
        for first, end in zip(edges[::2], edges[1::2], strict=True)
        if end - first >= CLOCK_STEP_SAMPLES and latest[first] > time_s[first]
    ]


def sample_nearest(time_s: Array, other_s: Array, values: Array) -> tuple[NDArray[np.bool_], Array]:
    """Another stream's ``values`` at the times of this one, and which of these times it has samples
    near to."""
    if other_s.size < 2:
        return np.zeros(time_s.size, bool), np.zeros(time_s.size)
    after = np.clip(np.searchsorted(other_s, time_s), 1, other_s.size - 1)
    nearest = np.minimum(np.abs(time_s - other_s[after - 1]), np.abs(time_s - other_s[after]))
    return nearest <= MAX_TIME_DIFFERENCE_S, np.interp(time_s, other_s, values)


def euler_rad(w: Array, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and yaw of a rotation from FRD to NED (Diebel 2006, equation 290)."""
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return roll, pitch, np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def content_sha256(parts: Mapping[str, bytes], parameters: Mapping[str, float]) -> str:
    """SHA-256 of what identification reads, and of the parameters.

    Not of the file, which also carries the wall clock: a dive that is flown again has the same
    digest."""
    total = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode())
    for name in sorted(parts):
        total.update(name.encode())
        total.update(parts[name])
    return total.hexdigest()


def foreign_log(
    path: Path,
    attitude: Attitude,
    actuators: Actuators,
    depth: Depth,
    setpoints: Setpoints,
    events: tuple[TextEvent, ...],
    parameters: dict[str, float],
    steps: Iterable[ClockStep],
) -> Log:
    """The log of another's autopilot: one clock, and no encoder at a duct."""
    parts = {"attitude": attitude, "actuators": actuators, "depth": depth}
    read_from = {
        f"{part}.{name}": values.tobytes()
        for part, of in parts.items()
        for name, values in vars(of).items()
    }
    return Log(
        name=path.name,
        sha256=content_sha256(read_from, parameters),
        attitude=attitude,
        actuators=actuators,
        depth=depth,
        setpoints=setpoints,
        events=events,
        parameters=parameters,
        duct=DuctAngles(*(np.empty(0),) * 3),
        clock=Clock(tuple(steps)),
    )
