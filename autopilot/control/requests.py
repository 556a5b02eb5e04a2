"""What a ground station may ask of the vehicle, as data: ``core.request`` answers each at once."""

from typing import NamedTuple

from autopilot.control.setpoints import AttitudeTarget, MotionTarget
from mavlink_io.mission_items import MissionItem


class Arm(NamedTuple):
    force: bool = False
    """Skip the pre-arm checks."""


class Disarm(NamedTuple):
    force: bool = False
    """Also under way."""


class SetMode(NamedTuple):
    number: int
    """``custom_mode`` of modes.py."""


class StartTest(NamedTuple):
    """An excitation, as MAV_CMD_USER_1 carries it."""

    axis: int
    magnitude: float
    """Degrees of rudder or elevator, percent of thrust."""
    start_hz: float
    stop_hz: float
    """Band of a chirp or a multisine; the clock of a pseudo-random sequence."""
    duration_s: float
    wave: int
    fade_s: float
    seed: int = 0
    switch_intervals: tuple[int, ...] = ()
    """Of a square wave."""


class StopTest(NamedTuple):
    pass


class LoadMission(NamedTuple):
    items: tuple[MissionItem, ...]


class SetMissionItem(NamedTuple):
    sequence: int


class ChangeTarget(NamedTuple):
    """New set-points where given; None keeps what is in force."""

    depth_m: float | None = None
    heading_rad: float | None = None
    thrust: float | None = None


class SetTarget(NamedTuple):
    """A set-point of a stream; OFFBOARD follows it."""

    target: AttitudeTarget | MotionTarget


class SetHome(NamedTuple):
    lat_deg: float
    lon_deg: float


class TestActuator(NamedTuple):
    """Move one actuator of a disarmed vehicle for a moment."""

    channel: int
    """0 rudder, 1 elevator, 2 thrust."""
    value: float
    """In [-1, 1]."""
    seconds: float
    """Vehicle time; 0 lets it go at once."""


Request = (
    Arm
    | Disarm
    | SetMode
    | StartTest
    | StopTest
    | LoadMission
    | SetMissionItem
    | ChangeTarget
    | SetTarget
    | SetHome
    | TestActuator
)
