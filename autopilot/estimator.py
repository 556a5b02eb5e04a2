"""Attitude, depth, speed and dead-reckoned position from the sensors of one tick.

Attitude: complementary filter on the quaternion with gyro bias (Mahony, Hamel and Pflimlin 2008, eq. 32), its
gravity reference freed of the turn's centripetal acceleration. Depth: pressure and vertical acceleration in a
third-order complementary filter with one triple pole. Position: heading and speed summed, reset by a satellite fix.

What the sample's ``fields_updated`` does not name is not used, and the rest carries on: without the gyro a second-order
observer takes the rates from the turning of gravity and field, without the pressure sensor depth is only carried along.
"""

import math

from autopilot.params import Config
from autopilot.types import Estimate, Home, Inputs
from link.frames import (
    STANDARD_GRAVITY_MPS2,
    Quaternion,
    euler_from_quaternion,
    geodetic_to_offset,
    quaternion_from_euler,
    rotate,
    rotate_back,
    wrap_pi,
)
from link.records import ACCELEROMETER_FRESH, GYRO_FRESH, MAGNETOMETER_FRESH, PRESSURE_FRESH, SensorFrame

NEEDED = ACCELEROMETER_FRESH | MAGNETOMETER_FRESH | PRESSURE_FRESH
"""To begin with."""

DRIFT_MPS = 0.15
"""One standard deviation of the unknown current and speed error that dead reckoning piles up."""
GPS_SD_M = 2.5
ALTIMETER_STALE_US = 1_000_000
TURNING_RADPS = math.radians(2.0)
"""Rate of turn at which the accelerometer and the magnetometer count half: sideslip and lost speed, which nobody
measures, then lean on the one, and through the tilt of the field's dip on the other. The gyro carries the turn."""
MAX_BIAS_RADPS = math.radians(1.0)
OBSERVER_RADPS = 2.0
"""Double pole of the observer that stands in for the gyro."""
BLIND_DEPTH_RATE_S = 10.0
"""Without the pressure sensor the vertical speed is forgotten in this time: carried further it would only mislead."""


def begin(sensors: SensorFrame, config: Config) -> Estimate:
    """The first estimate: level reference from the accelerometer, heading from the magnetometer, at rest."""
    roll = math.atan2(-sensors.accel_y_mps2, -sensors.accel_z_mps2)
    pitch = math.atan2(sensors.accel_x_mps2, math.hypot(sensors.accel_y_mps2, sensors.accel_z_mps2))
    north, east, _ = rotate(quaternion_from_euler(roll, pitch, 0.0), _magnetic(sensors))
    heading = wrap_pi(math.atan2(-east, north) + math.radians(config.declination_deg))
    return Estimate(
        attitude=quaternion_from_euler(roll, pitch, heading),
        roll_rad=roll,
        pitch_rad=pitch,
        heading_rad=heading,
        depth_m=depth_of(sensors.pressure_hpa, config),
        initialised=True,
        depth_time_us=sensors.time_us,
    )


def update(old: Estimate, inputs: Inputs, thrust: float, home: Home, config: Config, dt_s: float) -> Estimate:
    """The estimate after a tick of ``dt_s`` seconds under the last commanded ``thrust`` (fraction of full)."""
    sensors = inputs.sensors
    speed = _speed(old.speed_mps, thrust, config, dt_s)
    attitude, rates, bias = _attitude(old, sensors, speed, config, dt_s)
    roll, pitch, heading = euler_from_quaternion(*attitude)
    depth, depth_rate, accel_bias = _depth(old, sensors, attitude, config, dt_s)
    north, east, north_rate, east_rate, sd = _position(old, inputs, home, heading, pitch, speed, dt_s)
    altitude, altitude_time = _altitude(old, inputs)
    return Estimate(
        attitude, roll, pitch, heading, *rates, bias, depth, depth_rate, accel_bias, speed,
        north, east, north_rate, east_rate, sd, altitude, altitude_time, True,
        sensors.time_us if sensors.fields_updated & PRESSURE_FRESH else old.depth_time_us,
    )  # fmt: skip


def depth_of(pressure_hpa: float, config: Config) -> float:
    """Depth of an absolute pressure under the air pressure and density of the parameters."""
    gauge_pa = 100.0 * (pressure_hpa - config.surface_pressure_hpa)
    return gauge_pa / (config.water_density_kgpm3 * STANDARD_GRAVITY_MPS2)


def _magnetic(sensors: SensorFrame) -> tuple[float, float, float]:
    return sensors.mag_x_gauss, sensors.mag_y_gauss, sensors.mag_z_gauss


def _speed(speed_mps: float, thrust: float, config: Config, dt_s: float) -> float:
    """Forward speed through the water: thrust against quadratic drag."""
    steady = config.cruise_speed_mps * 100.0 * thrust / config.cruise_thrust_pct if config.cruise_thrust_pct else 0.0
    return speed_mps + (steady * abs(steady) - speed_mps * abs(speed_mps)) / config.speed_length_m * dt_s


def _attitude(
    old: Estimate, sensors: SensorFrame, speed_mps: float, config: Config, dt_s: float
) -> tuple[Quaternion, tuple[float, float, float], tuple[float, float, float]]:
    if not sensors.fields_updated & GYRO_FRESH:
        return _attitude_without_gyro(old, sensors, speed_mps, config, dt_s)
    bx, by, bz = old.gyro_bias_radps
    p, q, r = sensors.gyro_x_radps - bx, sensors.gyro_y_radps - by, sensors.gyro_z_radps - bz
    ex, ey, ez = _tilt_error(old.attitude, sensors, speed_mps, q, r)
    mx, my, mz = rotate_back(old.attitude, (0.0, 0.0, _heading_error(old.attitude, sensors, config)))
    trust = 1.0 / (1.0 + (q * q + r * r) / TURNING_RADPS**2)
    ka, kh, kb = trust * config.attitude_gain, trust * config.heading_gain, trust * config.bias_gain
    attitude = _integrate(old.attitude, p + ka * ex + kh * mx, q + ka * ey + kh * my, r + ka * ez + kh * mz, dt_s)
    bias = (
        _clip_bias(bx - kb * (ex + mx) * dt_s),
        _clip_bias(by - kb * (ey + my) * dt_s),
        _clip_bias(bz - kb * (ez + mz) * dt_s),
    )
    return attitude, (p, q, r), bias


def _attitude_without_gyro(
    old: Estimate, sensors: SensorFrame, speed_mps: float, config: Config, dt_s: float
) -> tuple[Quaternion, tuple[float, float, float], tuple[float, float, float]]:
    """Attitude and rates from gravity and field alone, the gyro's bias left as it was."""
    p, q, r = old.p_radps, old.q_radps, old.r_radps
    ex, ey, ez = _tilt_error(old.attitude, sensors, speed_mps, q, r)
    mx, my, mz = rotate_back(old.attitude, (0.0, 0.0, _heading_error(old.attitude, sensors, config)))
    ex, ey, ez = ex + mx, ey + my, ez + mz
    pull, gain = 2.0 * OBSERVER_RADPS, OBSERVER_RADPS * OBSERVER_RADPS * dt_s
    attitude = _integrate(old.attitude, p + pull * ex, q + pull * ey, r + pull * ez, dt_s)
    return attitude, (p + gain * ex, q + gain * ey, r + gain * ez), old.gyro_bias_radps


def _tilt_error(
    attitude: Quaternion, sensors: SensorFrame, speed_mps: float, q_radps: float, r_radps: float
) -> tuple[float, float, float]:
    """The turn (radians, body axes) that would lay the estimated down on the measured one; none without a measure."""
    if not sensors.fields_updated & ACCELEROMETER_FRESH:
        return 0.0, 0.0, 0.0
    ax = -sensors.accel_x_mps2
    ay = -sensors.accel_y_mps2 + r_radps * speed_mps
    az = -sensors.accel_z_mps2 - q_radps * speed_mps
    norm = math.sqrt(ax * ax + ay * ay + az * az)
    if norm < 0.5 * STANDARD_GRAVITY_MPS2:
        return 0.0, 0.0, 0.0
    w, x, y, z = attitude
    dx, dy, dz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return (ay * dz - az * dy) / norm, (az * dx - ax * dz) / norm, (ax * dy - ay * dx) / norm


def _heading_error(attitude: Quaternion, sensors: SensorFrame, config: Config) -> float:
    """The turn about the vertical (radians) that would bring the measured field to magnetic north; none without it."""
    if not sensors.fields_updated & MAGNETOMETER_FRESH:
        return 0.0
    north, east, _ = rotate(attitude, _magnetic(sensors))
    if north == 0.0 and east == 0.0:
        return 0.0
    return wrap_pi(math.radians(config.declination_deg) - math.atan2(east, north))


def _integrate(attitude: Quaternion, p: float, q: float, r: float, dt_s: float) -> Quaternion:
    w, x, y, z = attitude
    h = 0.5 * dt_s
    nw = w - h * (x * p + y * q + z * r)
    nx = x + h * (w * p + y * r - z * q)
    ny = y + h * (w * q + z * p - x * r)
    nz = z + h * (w * r + x * q - y * p)
    norm = 1.0 / math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    return nw * norm, nx * norm, ny * norm, nz * norm


def _clip_bias(bias_radps: float) -> float:
    return min(MAX_BIAS_RADPS, max(-MAX_BIAS_RADPS, bias_radps))


def _depth(
    old: Estimate, sensors: SensorFrame, attitude: Quaternion, config: Config, dt_s: float
) -> tuple[float, float, float]:
    down_mps2 = 0.0
    if sensors.fields_updated & ACCELEROMETER_FRESH:
        specific_force = sensors.accel_x_mps2, sensors.accel_y_mps2, sensors.accel_z_mps2
        down_mps2 = rotate(attitude, specific_force)[2] + STANDARD_GRAVITY_MPS2 - old.accel_bias_mps2
    if not sensors.fields_updated & PRESSURE_FRESH:
        fading = -old.depth_rate_mps / BLIND_DEPTH_RATE_S
        blind_mps = old.depth_rate_mps + (down_mps2 + fading) * dt_s
        return old.depth_m + old.depth_rate_mps * dt_s, blind_mps, old.accel_bias_mps2
    rate = 1.0 / config.depth_time_s
    depth = old.depth_m + old.depth_rate_mps * dt_s + 0.5 * down_mps2 * dt_s * dt_s
    error = depth_of(sensors.pressure_hpa, config) - depth
    return (
        depth + 3.0 * rate * error * dt_s,
        old.depth_rate_mps + (down_mps2 + 3.0 * rate * rate * error) * dt_s,
        old.accel_bias_mps2 - rate * rate * rate * error * dt_s,
    )


def _position(
    old: Estimate, inputs: Inputs, home: Home, heading_rad: float, pitch_rad: float, speed_mps: float, dt_s: float
) -> tuple[float, float, float, float, float]:
    ahead = speed_mps * math.cos(pitch_rad)
    north_rate, east_rate = ahead * math.cos(heading_rad), ahead * math.sin(heading_rad)
    fix = inputs.gps
    if fix is not None and fix.fix_type >= 3 and home.known:
        north, east = geodetic_to_offset(fix.lat_deg, fix.lon_deg, home.lat_deg, home.lon_deg)
        return north, east, north_rate, east_rate, GPS_SD_M
    return (
        old.north_m + north_rate * dt_s,
        old.east_m + east_rate * dt_s,
        north_rate,
        east_rate,
        old.position_sd_m + DRIFT_MPS * dt_s,
    )


def _altitude(old: Estimate, inputs: Inputs) -> tuple[float | None, int]:
    seen = inputs.altimeter
    if seen is not None and seen.min_range_m <= seen.range_m < seen.max_range_m:
        return seen.range_m, inputs.sensors.time_us
    if inputs.sensors.time_us - old.altitude_time_us > ALTIMETER_STALE_US:
        return None, old.altitude_time_us
    return old.altitude_m, old.altitude_time_us
