"""A recorded dive as arrays, independent of the format of its file (`sysid.data.readers`).

Axes are MAVLink's: NED and FRD, depth positive down, heading clockwise from north. Time is vehicle
time in seconds.
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum
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
    other_outputs: tuple[int, ...] = ()
    """Numbers of further outputs that move, counted from 1."""
    assumed_pulses: str = ""
    """Pulses that were taken for the range of an output, because the log does not contain it."""
    has_elevator: bool = True
    """False if no output is an elevator, whose command is zero then."""
    mixed_surfaces: str = ""
    """Outputs whose surfaces act in both planes, with the parameters that say so."""


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


class VelocitySource(StrEnum):
    """Origin of a velocity, the most direct first."""

    WATER_TRACK = "DVL, through the water"
    BOTTOM_TRACK = "DVL, over ground"
    COLUMN = "column of the file"
    ESTIMATE = "estimate of the autopilot, over ground"
    """Without DVL and satellite fixes it is a model of the autopilot (here: thrust table), and no
    measurement."""
    GROUND_SPEED = "speed over ground"
    NONE = "none"


def _no_samples() -> Array:
    """Return an empty array."""
    return np.empty(0)


@dataclass(frozen=True)
class Velocity:
    """Velocity in body axes (FRD); arrays of equal length, empty where the log has none.

    Sources over ground include the current.
    """

    time_s: Array = field(default_factory=_no_samples)
    forward_mps: Array = field(default_factory=_no_samples)
    starboard_mps: Array = field(default_factory=_no_samples)
    """NaN where only a speed was recorded, as is ``down_mps``."""
    down_mps: Array = field(default_factory=_no_samples)
    source: VelocitySource = VelocitySource.NONE


@dataclass(frozen=True)
class Position:
    """Estimated position north and east of the origin; empty arrays where the log has none."""

    time_s: Array = field(default_factory=_no_samples)
    north_m: Array = field(default_factory=_no_samples)
    east_m: Array = field(default_factory=_no_samples)


@dataclass(frozen=True)
class Current:
    """Estimated velocity of the water over ground; empty arrays where the log has none."""

    time_s: Array = field(default_factory=_no_samples)
    north_mps: Array = field(default_factory=_no_samples)
    east_mps: Array = field(default_factory=_no_samples)


@dataclass(frozen=True)
class SpecificForce:
    """Accelerometer in body axes (FRD): acceleration minus gravity, -9.8 in z at rest.

    Arrays of equal length, empty where the log has none.
    """

    time_s: Array = field(default_factory=_no_samples)
    x_mps2: Array = field(default_factory=_no_samples)
    y_mps2: Array = field(default_factory=_no_samples)
    z_mps2: Array = field(default_factory=_no_samples)


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
    time_s: Array = field(default_factory=_no_samples)
    """Times of ``ahead_s``."""
    ahead_s: Array = field(default_factory=_no_samples)
    """Time of the recorder minus time of the vehicle; empty where the log has vehicle time."""
    zero_unix_ns: int = 0
    """UNIX time of vehicle time zero; 0 where the log does not give it."""


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
    velocity: Velocity = Velocity()
    specific_force: SpecificForce = SpecificForce()
    position: Position = Position()
    current: Current = Current()
    home_deg: tuple[float, float] | None = None
    """Latitude and longitude of home; None where the log has none."""
