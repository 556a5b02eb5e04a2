"""Attitude, depth, speed and position from the sensors of one tick.

Attitude: complementary filter on the quaternion with gyro bias (Mahony, Hamel and Pflimlin 2008,
eq. 32), its gravity reference freed of the turn's centripetal acceleration. Depth: pressure and
vertical acceleration in a third-order complementary filter with one triple pole. Position:
``autopilot.control.navigation``.

What the sample's ``fields_updated`` does not name is not used, and the rest carries on: without the
gyro a second-order observer takes the rates from the turning of gravity and field, without the
pressure sensor depth is only carried along."""

import math

from autopilot.control import navigation
from autopilot.control.params import Config
from autopilot.control.types import Home, Inputs, VehicleEstimate
from mavlink_io.frames import (
    STANDARD_GRAVITY_MPS2,
    Quaternion,
    Vector,
    euler_from_quaternion,
    quaternion_from_euler,
    rotate,
    wrap_pi,
)
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    PRESSURE_FRESH,
    Altimeter,
    SensorFrame,
)

REQUIRED_FIELDS = ACCELEROMETER_FRESH | MAGNETOMETER_FRESH | PRESSURE_FRESH
"""To begin with."""

ALTIMETER_STALE_US = 1_000_000
TURN_RATE_GATE_RADPS = math.radians(2.0)
"""Rate of turn at which the accelerometer and the magnetometer count half: sideslip and lost speed,
which nobody measures, then lean on the one, and through the tilt of the field's dip on the other.
The gyro carries the turn."""
MAX_BIAS_RADPS = math.radians(1.0)
DEPTH_OBSERVER_RADPS = 2.0
"""Double pole of the observer that stands in for the gyro."""
DEPTH_RATE_DECAY_S = 10.0
"""Without the pressure sensor the vertical speed is forgotten in this time: carried further it
would only mislead."""


def initial_estimate(sensors: SensorFrame, config: Config) -> VehicleEstimate:
    """The first estimate: level reference from the accelerometer, heading from the magnetometer, at
    rest."""
    ax, ay, az = sensors[1:4]
    roll = math.atan2(-ay, -az)
    pitch = math.atan2(ax, math.hypot(ay, az))
    north, east, _ = rotate(quaternion_from_euler(roll, pitch, 0.0), sensors[7:10])
    heading = wrap_pi(math.atan2(-east, north) + config.declination_rad)
    return VehicleEstimate(
        attitude=quaternion_from_euler(roll, pitch, heading),
        roll_rad=roll,
        pitch_rad=pitch,
        heading_rad=heading,
        depth_m=depth_of(sensors.pressure_hpa, config),
        initialised=True,
        depth_time_us=sensors.time_us,
        navigation=navigation.initial_solution(config),
    )


def update(
    old: VehicleEstimate, inputs: Inputs, thrust: float, home: Home, config: Config, dt_s: float
) -> VehicleEstimate:
    """The estimate after a tick of ``dt_s`` seconds under the last commanded ``thrust`` (fraction
    of full)."""
    sensors, now_us = inputs.sensors, inputs.sensors.time_us
    speed = _speed(old.speed_mps, thrust, config, dt_s)
    attitude, rates, bias = _attitude(old, sensors, speed, config, dt_s)
    roll, pitch, heading = euler_from_quaternion(*attitude)
    depth, depth_rate, accel_bias = _depth(old, sensors, attitude, config, dt_s)
    ahead = speed * math.cos(pitch)
    water = complex(ahead * math.cos(heading), ahead * math.sin(heading))
    motion = navigation.MotionInput(now_us, attitude, water, thrust != 0.0, rates[2], depth_rate)
    place, over_ground, memory = navigation.predict_and_update(
        complex(old.north_m, old.east_m), old.navigation, motion, inputs, home, config, dt_s
    )
    altitude, altitude_time = _altitude(old, inputs.altimeter, now_us)
    return VehicleEstimate(
        attitude,
        roll,
        pitch,
        heading,
        *rates,
        bias,
        depth,
        depth_rate,
        accel_bias,
        speed,
        place.real,
        place.imag,
        over_ground.real,
        over_ground.imag,
        navigation.sd_m(memory),
        altitude,
        altitude_time,
        True,
        now_us if sensors.fields_updated & PRESSURE_FRESH else old.depth_time_us,
        memory,
    )


def depth_of(pressure_hpa: float, config: Config) -> float:
    """Depth of an absolute pressure under the air pressure and density of the parameters."""
    gauge_pa = 100.0 * (pressure_hpa - config.surface_pressure_hpa)
    return gauge_pa / (config.water_density_kgpm3 * STANDARD_GRAVITY_MPS2)


def _speed(speed_mps: float, thrust: float, config: Config, dt_s: float) -> float:
    """Forward speed through the water: thrust against quadratic drag.

    An Euler step that is too long for a fast vehicle would pass the steady speed and diverge: it
    ends there.
    """
    cruise_pct = config.cruise_thrust_pct
    steady = config.cruise_speed_mps * 100.0 * thrust / cruise_pct if cruise_pct else 0.0
    change = (steady * abs(steady) - speed_mps * abs(speed_mps)) / config.speed_length_m * dt_s
    if abs(change) > abs(steady - speed_mps):
        return steady
    return speed_mps + change


def _attitude(
    old: VehicleEstimate, sensors: SensorFrame, speed_mps: float, config: Config, dt_s: float
) -> tuple[Quaternion, Vector, Vector]:
    if not sensors.fields_updated & GYRO_FRESH:
        return _attitude_without_gyro(old, sensors, speed_mps, config, dt_s)
    bx, by, bz = old.gyro_bias_radps
    p, q, r = sensors[4:7]
    p, q, r = p - bx, q - by, r - bz
    (ex, ey, ez), (mx, my, mz) = _attitude_errors(old.attitude, sensors, speed_mps, q, r, config)
    trust = 1.0 / (1.0 + (q * q + r * r) / TURN_RATE_GATE_RADPS**2)
    ka, kh, kb = trust * config.attitude_gain, trust * config.heading_gain, trust * config.bias_gain
    attitude = _integrate(
        old.attitude, p + ka * ex + kh * mx, q + ka * ey + kh * my, r + ka * ez + kh * mz, dt_s
    )
    bias = (
        _clip_bias(bx - kb * (ex + mx) * dt_s),
        _clip_bias(by - kb * (ey + my) * dt_s),
        _clip_bias(bz - kb * (ez + mz) * dt_s),
    )
    return attitude, (p, q, r), bias


def _attitude_without_gyro(
    old: VehicleEstimate, sensors: SensorFrame, speed_mps: float, config: Config, dt_s: float
) -> tuple[Quaternion, Vector, Vector]:
    """Attitude and rates from gravity and field alone, the gyro's bias left as it was."""
    p, q, r = old.p_radps, old.q_radps, old.r_radps
    (ex, ey, ez), (mx, my, mz) = _attitude_errors(old.attitude, sensors, speed_mps, q, r, config)
    ex, ey, ez = ex + mx, ey + my, ez + mz
    pull, gain = 2.0 * DEPTH_OBSERVER_RADPS, DEPTH_OBSERVER_RADPS * DEPTH_OBSERVER_RADPS * dt_s
    attitude = _integrate(old.attitude, p + pull * ex, q + pull * ey, r + pull * ez, dt_s)
    return attitude, (p + gain * ex, q + gain * ey, r + gain * ez), old.gyro_bias_radps


def _down_vector(attitude: Quaternion) -> Vector:
    """The world's downward unit vector in body axes."""
    w, x, y, z = attitude
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _attitude_errors(
    attitude: Quaternion,
    sensors: SensorFrame,
    speed_mps: float,
    q_radps: float,
    r_radps: float,
    config: Config,
) -> tuple[Vector, Vector]:
    """The turns (radians, body axes) that would take the estimate to what gravity and what the
    field tell."""
    down = x, y, z = _down_vector(attitude)
    turn = _heading_error(attitude, sensors, config)
    return _tilt_error(down, sensors, speed_mps, q_radps, r_radps), (turn * x, turn * y, turn * z)


def _tilt_error(
    down: Vector, sensors: SensorFrame, speed_mps: float, q_radps: float, r_radps: float
) -> Vector:
    """The turn (radians, body axes) that would lay the estimated down on the measured one; none
    without a measure."""
    if not sensors.fields_updated & ACCELEROMETER_FRESH:
        return 0.0, 0.0, 0.0
    fx, fy, fz = sensors[1:4]
    ax, ay, az = -fx, -fy + r_radps * speed_mps, -fz - q_radps * speed_mps
    norm = math.sqrt(ax * ax + ay * ay + az * az)
    if norm < 0.5 * STANDARD_GRAVITY_MPS2:
        return 0.0, 0.0, 0.0
    dx, dy, dz = down
    return (ay * dz - az * dy) / norm, (az * dx - ax * dz) / norm, (ax * dy - ay * dx) / norm


def _heading_error(attitude: Quaternion, sensors: SensorFrame, config: Config) -> float:
    """The turn about the vertical (radians) that would bring the measured field to magnetic north;
    none without it."""
    if not sensors.fields_updated & MAGNETOMETER_FRESH:
        return 0.0
    north, east, _ = rotate(attitude, sensors[7:10])
    if north == 0.0 and east == 0.0:
        return 0.0
    return wrap_pi(config.declination_rad - math.atan2(east, north))


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
    return (
        bias_radps
        if -MAX_BIAS_RADPS < bias_radps < MAX_BIAS_RADPS
        else math.copysign(MAX_BIAS_RADPS, bias_radps)
    )


def _depth(
    old: VehicleEstimate, sensors: SensorFrame, attitude: Quaternion, config: Config, dt_s: float
) -> tuple[float, float, float]:
    rate_mps, bias_mps2, down_mps2 = old.depth_rate_mps, old.accel_bias_mps2, 0.0
    fresh = sensors.fields_updated
    if fresh & ACCELEROMETER_FRESH:
        (x, y, z), (ax, ay, az) = _down_vector(attitude), sensors[1:4]
        down_mps2 = x * ax + y * ay + z * az + STANDARD_GRAVITY_MPS2 - bias_mps2
    if not fresh & PRESSURE_FRESH:
        fading = -rate_mps / DEPTH_RATE_DECAY_S
        return old.depth_m + rate_mps * dt_s, rate_mps + (down_mps2 + fading) * dt_s, bias_mps2
    pole = 1.0 / config.depth_time_s
    depth = old.depth_m + rate_mps * dt_s + 0.5 * down_mps2 * dt_s * dt_s
    error = depth_of(sensors.pressure_hpa, config) - depth
    return (
        depth + 3.0 * pole * error * dt_s,
        rate_mps + (down_mps2 + 3.0 * pole * pole * error) * dt_s,
        bias_mps2 - pole * pole * pole * error * dt_s,
    )


def _altitude(
    old: VehicleEstimate, seen: Altimeter | None, now_us: int
) -> tuple[float | None, int]:
    if seen is not None and seen.min_range_m <= seen.range_m < seen.max_range_m:
        return seen.range_m, now_us
    seen_us = old.altitude_time_us
    return (None if now_us - seen_us > ALTIMETER_STALE_US else old.altitude_m), seen_us
