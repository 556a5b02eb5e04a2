"""A recorded dive as arrays, independent of the format of its file (`sysid.data.readers`).

Axes are MAVLink's: NED and FRD, depth positive down, heading clockwise from north. Time is vehicle
time in seconds.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.errors import ErrorCode, InputError
from sysid.data.events import VehicleEvent

Array = NDArray[np.float64]


DEFAULT_TRAVEL_DEG = 15.0
"""Surface angle at an output of 1 if neither the log nor the vehicle file gives it."""


class LogError(InputError):
    """Log that cannot be used; the message names the file, the error and what is expected."""

    code = ErrorCode.LOG


@dataclass(frozen=True)
class Attitude:
    """Attitude and body rates; arrays of equal length. Yaw is unwrapped."""

    time_s: Array
    roll_rad: Array
    pitch_rad: Array
    yaw_rad: Array
    p_radps: Array
    q_radps: Array
    r_radps: Array


@dataclass(frozen=True)
class Actuators:
    """Commands after the autopilot's limits; positive is nose to starboard, nose up, ahead."""

    time_s: Array
    rudder_rad: Array
    elevator_rad: Array
    thrust: Array
    """Fraction of full thrust, -1..1."""
    travel_rad: float = math.radians(DEFAULT_TRAVEL_DEG)
    """Surface angle at an output of 1."""


@dataclass(frozen=True)
class DuctAngles:
    """Measured duct angles from the tailcone's encoder; empty without an encoder."""

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
    """Setpoints of the autopilot; arrays are empty where the log has none."""

    attitude_time_s: Array
    heading_rad: Array
    """Unwrapped."""
    pitch_rad: Array
    depth_time_s: Array
    depth_m: Array


class LogEvent(NamedTuple):
    """Event at a vehicle time."""

    time_s: float
    value: VehicleEvent


class ClockStep(NamedTuple):
    """Backward step of a clock; later samples of that clock are left out."""

    message: str
    """Name of the message whose time stamps went back."""
    time_s: float
    """Latest time before the step."""
    back_s: float
    """Size of the step."""


@dataclass(frozen=True)
class Clock:
    """Errors of a log's time stamps."""

    steps: tuple[ClockStep, ...] = ()
    time_s: Array = field(default_factory=lambda: np.empty(0))
    """Times of ``ahead_s``."""
    ahead_s: Array = field(default_factory=lambda: np.empty(0))
    """Time of the recorder minus time of the vehicle; empty where the log has vehicle time."""


@dataclass(frozen=True)
class Log:
    """A recorded dive."""

    name: str
    """File name."""
    sha256: str
    """SHA-256 of the vehicle's messages and parameters, independent of the recording."""
    attitude: Attitude
    actuators: Actuators
    depth: Depth
    setpoints: Setpoints
    events: tuple[LogEvent, ...]
    """In the order of time."""
    parameters: dict[str, float]
    """Parameters of the autopilot by name."""
    duct: DuctAngles
    clock: Clock = Clock()
    damage: str = ""
    """Damaged places of the file and the time that is lost; empty for a whole file."""
