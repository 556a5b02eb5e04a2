"""True motion of the vehicle in FRD and NED, for sensors, logs and viewers, not for controllers."""

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
    """True state of the vehicle at one instant."""

    time_us: int
    position_ned_m: Vector
    attitude_q: Quaternion
    """Rotation from FRD to NED, scalar first."""
    velocity_ned_mps: Vector
    """Velocity over ground."""
    rates_radps: Vector
    specific_force_mps2: Vector
    """Specific force at the origin, where the accelerometer is mounted, FRD."""
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
    """Names of the faults in force: unit and kind."""
    surface_m: float = 0.0
    """Height of the surface above the still level, vertically above the origin."""
    wave_pressure_pa: float = 0.0
    """Pressure due to waves at the origin."""

    @property
    def speed_through_water_mps(self) -> float:
        """Magnitude of the velocity relative to the water."""
        return sqrt(
            sum(
                (v - c) ** 2
                for v, c in zip(self.velocity_ned_mps, self.water_velocity_ned_mps, strict=True)
            )
        )


def to_frame(truth: Truth, latitude_deg: float, longitude_deg: float) -> TruthFrame:
    """Return the fields of HIL_STATE_QUATERNION.

    Parameters
    ----------
    truth : Truth
        True state.
    latitude_deg, longitude_deg : float
        Geographic position of the origin of NED.
    """
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
