"""A recorded dive as arrays, whatever file it was read from (`sysid.data.readers`).

Axes are MAVLink's: NED and FRD, depth positive down, heading clockwise from north. Time is vehicle
time in seconds."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class LogError(ValueError):
    """A file that is no usable log; the message names the file, what is wrong and what would be
    right."""


@dataclass(frozen=True)
class Attitude:
    """Arrays of equal length. Yaw is unwrapped."""

    time_s: Array
    roll_rad: Array
    pitch_rad: Array
    yaw_rad: Array
    p_radps: Array
    q_radps: Array
    r_radps: Array


@dataclass(frozen=True)
class Actuators:
    """What was commanded, after the autopilot's limits. Positive: nose to starboard, nose up,
    ahead."""

    time_s: Array
    rudder_rad: Array
    elevator_rad: Array
    thrust: Array
    """Fraction of full thrust, -1..1."""


@dataclass(frozen=True)
class DuctAngles:
    """Where the duct really stood, by the tailcone's own encoder. Empty where it has none."""

    time_s: Array
    rudder_rad: Array
    elevator_rad: Array


@dataclass(frozen=True)
class Depth:
    """Depth and its rate, positive down."""

    time_s: Array
    depth_m: Array
    rate_mps: Array


@dataclass(frozen=True)
class Setpoints:
    """What was asked for. Arrays are empty where the log does not tell."""

    attitude_time_s: Array
    heading_rad: Array
    """Unwrapped."""
    pitch_rad: Array
    depth_time_s: Array
    depth_m: Array


@dataclass(frozen=True)
class TextEvent:
    """One text of the vehicle's, its chunks joined."""

    time_s: float
    severity: int
    text: str


class ClockStep(NamedTuple):
    """A clock that went back and stayed back; what it stamped from there on is left out."""

    what: str
    """Whose time stamps they are: a message's name."""
    time_s: float
    """The latest time before it."""
    back_s: float


@dataclass(frozen=True)
class Clock:
    """What is known against a log's time stamps."""

    steps: tuple[ClockStep, ...] = ()
    time_s: Array = field(default_factory=lambda: np.empty(0))
    ahead_s: Array = field(default_factory=lambda: np.empty(0))
    """Recorder's time, which the log goes by, less the vehicle's own. Empty where the log goes by
    the vehicle's."""


@dataclass(frozen=True)
class Log:
    name: str
    sha256: str
    """Of the vehicle's messages and parameters, whenever and wherever they were recorded."""
    attitude: Attitude
    actuators: Actuators
    depth: Depth
    setpoints: Setpoints
    events: tuple[TextEvent, ...]
    parameters: dict[str, float]
    duct: DuctAngles
    clock: Clock = Clock()
