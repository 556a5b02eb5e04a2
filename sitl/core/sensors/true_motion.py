"""What the slower sensors measure: fields of ``core.truth.Truth`` that are numbers."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.frames import Quaternion, Vector


class TrueMotion(NamedTuple):
    """True motion at one instant, with the names of ``Truth``; FRD and NED."""

    time_us: int
    position_ned_m: Vector
    attitude_q: Quaternion
    velocity_ned_mps: Vector
    water_velocity_ned_mps: Vector
    rudder_rad: float
    elevator_rad: float
    propeller_rps: float
    surface_m: float
    flooding: bool
