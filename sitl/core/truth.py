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
from mavlink_io.jit import numeric
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


@numeric
def _speed_mps(velocity: Vector, water_velocity: Vector) -> float:
    """Return the magnitude of a velocity relative to the water."""
    x, y, z = (
        velocity[0] - water_velocity[0],
        velocity[1] - water_velocity[1],
        velocity[2] - water_velocity[2],
    )
    return sqrt(x * x + y * y + z * z)


def to_frame(truth: Truth, latitude_deg: float, longitude_deg: float) -> TruthFrame:
    """Return the fields of HIL_STATE_QUATERNION.

    Parameters
    ----------
    truth : Truth
        True state.
    latitude_deg, longitude_deg : float
        Geographic position of the origin of NED.
    """
    position = frame_position(truth.position_ned_m, latitude_deg, longitude_deg)
    motion = frame_motion(
        truth.velocity_ned_mps, truth.water_velocity_ned_mps, truth.specific_force_mps2
    )
    return TruthFrame(truth.time_us, truth.attitude_q, *truth.rates_radps, *position, *motion)


@numeric
def frame_position(
    position_ned_m: Vector, latitude_deg: float, longitude_deg: float
) -> tuple[int, int, int]:
    """Return latitude, longitude (1e-7 deg) and altitude (mm) of HIL_STATE_QUATERNION.

    Parameters
    ----------
    position_ned_m : Vector
        Position.
    latitude_deg, longitude_deg : float
        Geographic position of the origin of NED.
    """
    latitude, longitude = offset_to_geodetic(
        position_ned_m[0], position_ned_m[1], latitude_deg, longitude_deg
    )
    return round(1e7 * latitude), round(1e7 * longitude), round(-1000.0 * position_ned_m[2])


@numeric
def frame_motion(
    velocity_ned_mps: Vector, water_velocity_ned_mps: Vector, specific_force_mps2: Vector
) -> tuple[int, int, int, int, int, int, int, int]:
    """Return the fields of HIL_STATE_QUATERNION that follow the position.

    Parameters
    ----------
    velocity_ned_mps, water_velocity_ned_mps : Vector
        Velocity of the vehicle and of the water over ground.
    specific_force_mps2 : Vector
        Specific force at the origin, FRD.

    Returns
    -------
    tuple of int
        Velocity (cm/s), speed through the water twice (cm/s), specific force (mG).
    """
    velocity, force = velocity_ned_mps, specific_force_mps2
    speed_cmps = round(100.0 * _speed_mps(velocity, water_velocity_ned_mps))
    return (
        round(100.0 * velocity[0]),
        round(100.0 * velocity[1]),
        round(100.0 * velocity[2]),
        speed_cmps,
        speed_cmps,
        round(1000.0 * force[0] / STANDARD_GRAVITY_MPS2),
        round(1000.0 * force[1] / STANDARD_GRAVITY_MPS2),
        round(1000.0 * force[2] / STANDARD_GRAVITY_MPS2),
    )
