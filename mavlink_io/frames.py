"""The one conversion between the vehicle model's axes and MAVLink's.

The paper's vehicle model has x forward, y to port, z up (FLU) in a world of x north, y west, z up
(NWU). MAVLink, the autopilot, ground and logs have forward-right-down (FRD) in north-east-down
(NED). Both pairs differ by half a turn about x, so one rule serves vectors of the body and of the
world, and the same rule leads back."""

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

STANDARD_GRAVITY_MPS2 = 9.80665
EARTH_RADIUS_M = 6_371_000.0


def flip(x: float, y: float, z: float) -> Vector:
    """Turn a vector (or an axial vector: rates, moments) from FLU/NWU to FRD/NED, or back."""
    return x, -y, -z


def flip_quaternion(w: float, x: float, y: float, z: float) -> Quaternion:
    """Turn an attitude quaternion (body to world, scalar first) from FLU/NWU to FRD/NED, or
    back."""
    return w, x, -y, -z


def wrap_pi(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Scalar-first quaternion of the yaw-pitch-roll sequence (body to world)."""
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler_from_quaternion(w: float, x: float, y: float, z: float) -> Vector:
    """Roll, pitch and yaw in radians of a scalar-first unit quaternion (body to world)."""
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def rotate(q: Quaternion, v: Vector) -> Vector:
    """The body vector ``v`` in world axes."""
    w, x, y, z = q
    tx = 2.0 * (y * v[2] - z * v[1])
    ty = 2.0 * (z * v[0] - x * v[2])
    tz = 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


def rotate_back(q: Quaternion, v: Vector) -> Vector:
    """The world vector ``v`` in body axes."""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


def offset_to_geodetic(
    north_m: float, east_m: float, origin_lat_deg: float, origin_lon_deg: float
) -> tuple[float, float]:
    """Latitude and longitude in degrees of a small offset from an origin (spherical earth, flat
    neighbourhood)."""
    lat = origin_lat_deg + math.degrees(north_m / EARTH_RADIUS_M)
    lon = origin_lon_deg + math.degrees(
        east_m / (EARTH_RADIUS_M * math.cos(math.radians(origin_lat_deg)))
    )
    return lat, lon


def geodetic_to_offset(
    lat_deg: float, lon_deg: float, origin_lat_deg: float, origin_lon_deg: float
) -> tuple[float, float]:
    """North and east offset in metres from an origin: the inverse of ``offset_to_geodetic``."""
    north = math.radians(lat_deg - origin_lat_deg) * EARTH_RADIUS_M
    east = (
        math.radians(lon_deg - origin_lon_deg)
        * EARTH_RADIUS_M
        * math.cos(math.radians(origin_lat_deg))
    )
    return north, east
