"""What really happens, in FRD and NED: for instruments to read, for logs and viewers. No controller
may see it."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from mavlink_io.frames import (
    STANDARD_GRAVITY_MPS2,
    Quaternion,
    Vector,
    offset_to_geodetic,
)
from mavlink_io.records import TruthFrame


class Truth(NamedTuple):
    """The vehicle at one instant. ``attitude_q`` turns body FRD into NED, scalar first."""

    time_us: int
    position_ned_m: Vector
    attitude_q: Quaternion
    velocity_ned_mps: Vector
    """Over ground."""
    rates_radps: Vector
    specific_force_mps2: Vector
    """At the origin, where the accelerometer sits."""
    water_velocity_ned_mps: Vector
    rudder_rad: float
    elevator_rad: float
    """True duct angles, bias included."""
    propeller_rps: float
    pitch_disturbance_nm: float
    yaw_disturbance_nm: float
    flooding: bool = False
    """Whether there is water in the hull."""
    faults: tuple[str, ...] = ()
    """What is wrong on board, unit and kind."""
    surface_m: float = 0.0
    """Height of the surface above its still level, over the origin."""
    wave_pressure_pa: float = 0.0
    """What the waves add at the origin to the pressure of still water."""

    @property
    def speed_through_water_mps(self) -> float:
        return sqrt(
            sum(
                (v - c) ** 2
                for v, c in zip(self.velocity_ned_mps, self.water_velocity_ned_mps, strict=True)
            )
        )


def to_frame(truth: Truth, latitude_deg: float, longitude_deg: float) -> TruthFrame:
    """HIL_STATE_QUATERNION of a truth, for a vehicle that counts north and east from the given
    place."""
    latitude, longitude = offset_to_geodetic(*truth.position_ned_m[:2], latitude_deg, longitude_deg)
    speed_cmps = round(100.0 * truth.speed_through_water_mps)
    north_cmps, east_cmps, down_cmps = (round(100.0 * v) for v in truth.velocity_ned_mps)
    x_mg, y_mg, z_mg = (
        round(1000.0 * a / STANDARD_GRAVITY_MPS2) for a in truth.specific_force_mps2
    )
    return TruthFrame(
        truth.time_us,
        truth.attitude_q,
        *truth.rates_radps,
        round(1e7 * latitude),
        round(1e7 * longitude),
        round(-1000.0 * truth.position_ned_m[2]),
        north_cmps,
        east_cmps,
        down_cmps,
        speed_cmps,
        speed_cmps,
        x_mg,
        y_mg,
        z_mg,
    )
