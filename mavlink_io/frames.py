"""Axes, attitudes and positions: the only conversion between the model's axes and MAVLink's.

The paper's vehicle model uses x forward, y to port, z up (FLU) in a world of x north, y west, z up
(NWU). MAVLink, the autopilot, ground and logs use forward-right-down (FRD) in north-east-down
(NED). Both pairs of axes differ by half a turn about x: one function converts vectors of the body
and of the world, in both directions.
"""

import math

from mavlink_io.jit import numeric

Vector = tuple[float, float, float]
"""Three components along x, y and z."""
Quaternion = tuple[float, float, float, float]
"""Unit quaternion w, x, y, z from body to world axes, scalar first."""

STANDARD_GRAVITY_MPS2 = 9.80665
"""Standard acceleration of gravity (3rd CGPM, 1901)."""
EARTH_RADIUS_M = 6_371_000.0
"""Mean radius of the earth, of the spherical model of positions."""


@numeric
def flip(x: float, y: float, z: float) -> Vector:
    """Convert a vector from FLU/NWU to FRD/NED axes, or back.

    Parameters
    ----------
    x, y, z : float
        Components of a polar vector, or of an axial one (angular rate, moment), in any unit.

    Returns
    -------
    Vector
        Components in the other axes.
    """
    return x, -y, -z


@numeric
def flip_quaternion(w: float, x: float, y: float, z: float) -> Quaternion:
    """Convert an attitude quaternion from FLU/NWU to FRD/NED axes, or back.

    Parameters
    ----------
    w, x, y, z : float
        Unit quaternion from body to world, scalar first.

    Returns
    -------
    Quaternion
        Quaternion between the other axes.
    """
    return w, x, -y, -z


@numeric
def wrap_pi(angle_rad: float) -> float:
    """Return the equivalent angle in [-pi, pi).

    Parameters
    ----------
    angle_rad : float
        Any angle, in rad.

    Returns
    -------
    float
        Angle in rad.
    """
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@numeric
def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Return the quaternion of Euler angles.

    Parameters
    ----------
    roll_rad, pitch_rad, yaw_rad : float
        Euler angles of the yaw-pitch-roll sequence (Z-Y-X) from world to body, in rad.

    Returns
    -------
    Quaternion
        Unit quaternion from body to world, scalar first.

    Notes
    -----
    q = q_z(yaw) q_y(pitch) q_x(roll), with c = cos(angle / 2) and s = sin(angle / 2).
    """
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@numeric
def euler_from_quaternion(w: float, x: float, y: float, z: float) -> Vector:
    """Return the Euler angles of a quaternion.

    Parameters
    ----------
    w, x, y, z : float
        Unit quaternion from body to world, scalar first.

    Returns
    -------
    Vector
        Roll, pitch and yaw of the yaw-pitch-roll sequence (Z-Y-X), in rad.
    """
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


@numeric
def rotate(q: Quaternion, v: Vector) -> Vector:
    """Return a body vector in world axes.

    Parameters
    ----------
    q : Quaternion
        Unit quaternion (w, u) from body to world, scalar first.
    v : Vector
        Vector in body axes.

    Returns
    -------
    Vector
        The vector in world axes.

    Notes
    -----
    t = 2 u x v; v' = v + w t + u x t.
    """
    w, x, y, z = q
    tx = 2.0 * (y * v[2] - z * v[1])
    ty = 2.0 * (z * v[0] - x * v[2])
    tz = 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


@numeric
def rotate_back(q: Quaternion, v: Vector) -> Vector:
    """Return a world vector in body axes.

    Parameters
    ----------
    q : Quaternion
        Unit quaternion from body to world, scalar first.
    v : Vector
        Vector in world axes.

    Returns
    -------
    Vector
        The vector in body axes.
    """
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


@numeric
def offset_to_geodetic(
    north_m: float, east_m: float, origin_lat_deg: float, origin_lon_deg: float
) -> tuple[float, float]:
    """Return the latitude and longitude of a small offset from an origin.

    Parameters
    ----------
    north_m, east_m : float
        Offset from the origin, in m.
    origin_lat_deg, origin_lon_deg : float
        Latitude and longitude of the origin, in deg.

    Returns
    -------
    tuple of float
        Latitude and longitude, in deg; the longitude is within 180 deg of zero.

    Notes
    -----
    Spherical earth, flat neighbourhood: dlat = north / R, dlon = east / (R cos(lat0)).
    """
    lat = origin_lat_deg + math.degrees(north_m / EARTH_RADIUS_M)
    lon = origin_lon_deg + math.degrees(
        east_m / (EARTH_RADIUS_M * math.cos(math.radians(origin_lat_deg)))
    )
    if abs(lon) > 180.0:
        lon -= math.copysign(360.0, lon)
    return lat, lon


@numeric
def geodetic_to_offset(
    lat_deg: float, lon_deg: float, origin_lat_deg: float, origin_lon_deg: float
) -> tuple[float, float]:
    """Return the offset of a position from an origin: the inverse of ``offset_to_geodetic``.

    Parameters
    ----------
    lat_deg, lon_deg : float
        Latitude and longitude of the position, in deg.
    origin_lat_deg, origin_lon_deg : float
        Latitude and longitude of the origin, in deg.

    Returns
    -------
    tuple of float
        North and east offset, in m.
    """
    lon_offset_deg = lon_deg - origin_lon_deg
    if abs(lon_offset_deg) > 180.0:  # the shorter difference, across the antimeridian
        lon_offset_deg -= math.copysign(360.0, lon_offset_deg)
    north = math.radians(lat_deg - origin_lat_deg) * EARTH_RADIUS_M
    east = math.radians(lon_offset_deg) * EARTH_RADIUS_M * math.cos(math.radians(origin_lat_deg))
    return north, east
