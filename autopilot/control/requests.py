"""Requests of ground stations as data; ``request_handler.handle_request`` handles them."""

import math
from typing import NamedTuple

from autopilot.control.setpoints import AttitudeTarget, MotionTarget
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    LOCAL_SCALE,
    NOT_GIVEN,
    MavCmd,
    MissionItem,
)


class Arm(NamedTuple):
    """Arm the vehicle."""

    force: bool = False
    """Whether to skip the pre-arm checks."""


class Disarm(NamedTuple):
    """Disarm the vehicle."""

    force: bool = False
    """Whether to disarm also while submerged."""


class SetMode(NamedTuple):
    """Change the mode."""

    number: int
    """``custom_mode`` of modes.py."""


class StartTest(NamedTuple):
    """Start a test (MAV_CMD_USER_1)."""

    axis: int
    """Axis, numbered as in SID_AXIS."""
    magnitude: float
    """Amplitude: degrees of rudder or elevator, percent of thrust."""
    start_hz: float
    stop_hz: float
    """Upper limit of the band of a chirp or a multisine; clock rate of a PRBS."""
    duration_s: float
    wave: int
    """Waveform, numbered as in SID_WAVE."""
    fade_s: float
    seed: int = 0
    """Seed of a PRBS."""
    switch_intervals: tuple[int, ...] = ()
    """Switch intervals of a square wave."""


class StopTest(NamedTuple):
    """Stop the test in progress."""


class LoadMission(NamedTuple):
    """Replace the mission."""

    items: tuple[MissionItem, ...]


class LoadFence(NamedTuple):
    """Replace the geofence."""

    items: tuple[MissionItem, ...]


class LoadRally(NamedTuple):
    """Replace the rally points."""

    items: tuple[MissionItem, ...]


class GoTo(NamedTuple):
    """Go to a place and circle it in mode STATION, or only change the depth."""

    item: MissionItem
    """NAV_LOITER_UNLIM: circle its place, or the vehicle's if it has none.
    CONDITION_CHANGE_ALT: change the depth in STATION or HOLD, from another mode in HOLD."""
    speed_mps: float | None = None
    """Speed through the water; None for that of ``SPD_CRUISE_MPS``, or in STATION the present."""
    changes_mode: bool = True
    """Whether to leave another mode than HOLD and STATION."""


class SetMissionItem(NamedTuple):
    """Set the current mission item."""

    sequence: int | None
    """Number of the item; None for the current one, which is not started again."""
    reset: bool = False
    """Whether the counts of jumps begin again at zero, and a completed mission is no longer
    complete."""


class ChangeTarget(NamedTuple):
    """Change set-points; None keeps the present one."""

    depth_m: float | None = None
    heading_rad: float | None = None
    thrust: float | None = None
    """Fraction of full thrust."""


class SetTarget(NamedTuple):
    """Set the target of a stream, which mode OFFBOARD follows."""

    target: AttitudeTarget | MotionTarget


class SetHome(NamedTuple):
    """Set the home position."""

    lat_deg: float
    lon_deg: float


class TestActuator(NamedTuple):
    """Test one actuator of a disarmed vehicle."""

    channel: int
    """0 rudder, 1 elevator, 2 thrust."""
    value: float
    """Command in [-1, 1]."""
    seconds: float
    """Duration in vehicle time; 0 ends the test at once."""


Request = (
    Arm
    | Disarm
    | SetMode
    | StartTest
    | StopTest
    | LoadMission
    | LoadFence
    | LoadRally
    | GoTo
    | SetMissionItem
    | ChangeTarget
    | SetTarget
    | SetHome
    | TestActuator
)


def go_to_target(target: MotionTarget) -> GoTo | None:
    """Return the request to circle the place, or to change to the depth, of a motion target.

    None if it has no place, and no depth or more than a depth.
    """
    depth_m = math.nan if target.depth_m is None else target.depth_m
    if target.position_m is None:
        if target != MotionTarget(depth_m=target.depth_m) or target.depth_m is None:
            return None
        command, x, y = MavCmd.CONDITION_CHANGE_ALT, NOT_GIVEN, NOT_GIVEN
    else:
        command = MavCmd.NAV_LOITER_UNLIM
        x = round(target.position_m.real * LOCAL_SCALE)
        y = round(target.position_m.imag * LOCAL_SCALE)
    item = MissionItem(0, FRAME_LOCAL_NED, command, x=x, y=y, z=depth_m)
    return GoTo(item, target.speed_mps)
