"""Estimate attitude, depth, speed and position from the sensors of one tick. Pure.

Body axes FRD, world NED, SI units. Symbols: R attitude (body to NED, as a quaternion), d = R^T e_3
unit vector down in body axes, f specific force (m/s^2), w = (p, q, r) gyro rates, b gyro bias, U
forward speed, z depth.

Attitude
    Complementary filter on the quaternion with gyro bias (Mahony, Hamel and Pflimlin 2008,
    eq. 32). Its gravity reference is corrected for the centripetal acceleration w x U.
Depth
    Third-order complementary filter of pressure and vertical acceleration with a triple pole.
Speed
    Balance of thrust and quadratic drag.
Position
    ``autopilot.control.navigation``.

Only the sensor groups in ``fields_updated`` are used. Without the gyro, a second-order observer
estimates the rates from gravity and magnetic field; without the pressure sensor, depth is
the integral of the vertical speed.
"""

import cmath
import math

from autopilot.control import navigation
from autopilot.control.params import Config
from autopilot.control.types import (
    PRESSURE_HELD,
    US_PER_S,
    Home,
    Inputs,
    Motion,
    VehicleEstimate,
)
from mavlink_io.frames import (
    STANDARD_GRAVITY_MPS2,
    Quaternion,
    Vector,
    euler_from_quaternion,
    quaternion_from_euler,
    rotate,
    wrap_pi,
)
from mavlink_io.jit import numeric
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    ATTITUDE_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    NO_FIX,
    NO_PING,
    PRESSURE_FRESH,
    Altimeter,
    Dvl,
    GpsFix,
    SensorFrame,
)

REQUIRED_FIELDS = ATTITUDE_FRESH | PRESSURE_FRESH
"""Sensor groups that the first estimate needs."""

_UNKNOWN: Vector = (math.nan, math.nan, math.nan)
"""Attitude error without one of the sensors that measure it."""
ALTIMETER_STALE_US = 1_000_000
"""Maximum age of an altitude."""
TURN_RATE_GATE_RADPS = math.radians(2.0)
"""Turn rate at which accelerometer and magnetometer have half their weight.

In a turn, sideslip and speed loss are not measured and bias the accelerometer; the tilt error then
biases the magnetometer through the dip of the field. The gyro alone carries fast turns.
"""
MAX_BIAS_RADPS = math.radians(1.0)
"""Limit of the gyro bias estimate."""
RATE_OBSERVER_RADPS = 2.0
"""Double pole of the observer that replaces the gyro."""
ATTITUDE_RESTART_RAD = math.radians(8.0)
"""Attitude error at which that observer starts again: it is that of a gyro that was wrong until it
was excluded. The observer would show it as a rate, of 20 deg/s for 12 deg."""
DEPTH_RATE_DECAY_S = 10.0
"""Time constant with which the vertical speed decays to zero without the pressure sensor."""
DEPTH_RESTART_US = 1_000_000
"""Time without the pressure sensor after which its next reading replaces the depth. An observer
that removed a difference of metres within EST_DPT_TIME would have a depth rate of many m/s, and a
bias of the acceleration that drives the depth away when the sensor is lost again."""
MAX_RATE_CORRECTION_MPS = 0.5
"""Largest mean error of the vertical speed that the first reading after DEPTH_RESTART_US corrects.

It is that of a vehicle that dives at full pitch; a greater one is an offset of the sensor."""


def initial_estimate(sensors: SensorFrame, config: Config) -> VehicleEstimate:
    """Return the first estimate, of a vehicle at rest.

    With f the specific force (body axes) and m the magnetic field after rotation by roll and pitch
    (north-east plane of the vehicle)::

        roll    = atan2(-f_y, -f_z)
        pitch   = atan2(f_x, hypot(f_y, f_z))
        heading = atan2(-m_east, m_north) + MAG_DECL_DEG

    At rest f = -g d; the equations are those of M. Pedley, "Tilt sensing using a three-axis
    accelerometer", Freescale AN3461 (2013). Depth follows from the pressure.
    """
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
    """Advance the estimate by one tick.

    Parameters
    ----------
    old : VehicleEstimate
        Estimate after the last tick.
    inputs : Inputs
        Sensors of this tick, checked.
    thrust : float
        Last commanded thrust (fraction of full).
    home : Home
        Home position.
    config : Config
        Parameters.
    dt_s : float
        Time since the last tick.

    Returns
    -------
    VehicleEstimate
        Estimate of this tick.
    """
    located = inputs.gps is not None or inputs.dvl is not None
    estimate, motion = predict(old, inputs.sensors, thrust, config, dt_s, located)
    if located:
        fix, ping = inputs.gps or NO_FIX, inputs.dvl or NO_PING
        estimate = use_position(estimate, motion, fix, inputs.dvl is not None, ping, home, config)
    if inputs.altimeter is not None:
        estimate = use_range(estimate, motion, inputs.altimeter)
    return estimate


@numeric
def use_position(
    estimate: VehicleEstimate,
    motion: navigation.MotionInput,
    fix: GpsFix,
    has_ping: bool,
    ping: Dvl,
    home: Home,
    config: Config,
) -> VehicleEstimate:
    """Return the estimate of ``predict`` after ``navigation.correct``."""
    solution = navigation.NavSolution(
        complex(estimate.north_m, estimate.east_m),
        complex(estimate.north_rate_mps, estimate.east_rate_mps),
        estimate.navigation,
    )
    corrected = navigation.correct(solution, motion, fix, has_ping, ping, home, config)
    if cmath.isfinite(corrected.position_m) and cmath.isfinite(corrected.velocity_mps):
        return _at(corrected, estimate)
    return estimate


@numeric
def use_range(
    estimate: VehicleEstimate, motion: navigation.MotionInput, echo: Altimeter
) -> VehicleEstimate:
    """Return the estimate with the altitude of a valid range."""
    if not echo.min_range_m <= echo.range_m < echo.max_range_m:
        return estimate
    return estimate._replace(altitude_m=echo.range_m, altitude_time_us=motion.time_us)


@numeric
def predict(
    old: VehicleEstimate,
    sensors: SensorFrame,
    thrust: float,
    config: Config,
    dt_s: float,
    located: bool,
) -> tuple[VehicleEstimate, navigation.MotionInput]:
    """Advance the estimate by the sensor frame of one tick.

    Parameters
    ----------
    old : VehicleEstimate
        Estimate after the last tick.
    sensors : SensorFrame
        Sensor frame of this tick, checked.
    thrust : float
        Last commanded thrust (fraction of full).
    config : Config
        Parameters.
    dt_s : float
        Time since the last tick.
    located : bool
        Whether ``use_position`` follows, with a satellite fix or a Doppler log velocity.

    Returns
    -------
    tuple[VehicleEstimate, MotionInput]
        Estimate before that correction, and the motion that it needs.
    """
    now_us = sensors.time_us
    speed = _speed(old.speed_mps, thrust, config, dt_s)
    attitude, rates, bias, error = _attitude(old, sensors, speed, config, dt_s)
    roll, pitch, heading = euler_from_quaternion(attitude[0], attitude[1], attitude[2], attitude[3])
    depth, depth_rate, accel_bias = _depth(old, sensors, attitude, config, dt_s)
    horizontal = speed * math.cos(pitch)
    water = complex(horizontal * math.cos(heading), horizontal * math.sin(heading))
    motion = navigation.MotionInput(now_us, attitude, water, thrust != 0.0, rates[2], depth_rate)
    position_m = complex(old.north_m, old.east_m)
    solution = navigation.predict(position_m, old.navigation, motion, config, dt_s, located)
    echo_is_old = now_us - old.altitude_time_us > ALTIMETER_STALE_US
    depth_measured = _has_new_depth(sensors.fields_updated)
    position, velocity, memory = solution
    estimate = VehicleEstimate(
        attitude,
        roll,
        pitch,
        heading,
        rates[0],
        rates[1],
        rates[2],
        bias,
        depth,
        depth_rate,
        accel_bias,
        speed,
        position.real,
        position.imag,
        velocity.real,
        velocity.imag,
        navigation.sd_m(memory),
        math.nan if echo_is_old else old.altitude_m,
        old.altitude_time_us,
        True,
        now_us if depth_measured else old.depth_time_us,
        memory,
        error,
        sensors.fields_updated & GYRO_FRESH != 0,
    )
    return estimate, motion


@numeric
def motion_of(estimate: VehicleEstimate, time_us: int) -> Motion:
    """Return the numbers of an estimate that telemetry reports several times a second.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimate of a tick.
    time_us : int
        Vehicle time of the tick.

    Returns
    -------
    Motion
        All of them as floats.
    """
    w, x, y, z = estimate.attitude
    velocity_sd_mps = navigation.velocity_sd_mps(estimate.navigation, estimate.speed_mps, time_us)
    return Motion(
        estimate.roll_rad,
        estimate.pitch_rad,
        estimate.heading_rad,
        estimate.p_radps,
        estimate.q_radps,
        estimate.r_radps,
        estimate.north_m,
        estimate.east_m,
        estimate.depth_m,
        estimate.north_rate_mps,
        estimate.east_rate_mps,
        estimate.depth_rate_mps,
        w,
        x,
        y,
        z,
        estimate.speed_mps,
        estimate.altitude_m,
        estimate.position_sd_m,
        velocity_sd_mps,
    )


@numeric
def _at(solution: navigation.NavSolution, estimate: VehicleEstimate) -> VehicleEstimate:
    """Return the estimate with another solution of the navigation."""
    return estimate._replace(
        north_m=solution.position_m.real,
        east_m=solution.position_m.imag,
        north_rate_mps=solution.velocity_mps.real,
        east_rate_mps=solution.velocity_mps.imag,
        position_sd_m=navigation.sd_m(solution.memory),
        navigation=solution.memory,
    )


@numeric
def depth_of(pressure_hpa: float, config: Config) -> float:
    """Return the depth (m) of an absolute pressure: z = (p - EST_SURF_HPA) / (EST_DENSITY g)."""
    gauge_pa = 100.0 * (pressure_hpa - config.surface_pressure_hpa)
    return gauge_pa / (config.water_density_kgpm3 * STANDARD_GRAVITY_MPS2)


@numeric
def _speed(speed_mps: float, thrust: float, config: Config, dt_s: float) -> float:
    """Return the forward speed through the water, by thrust against quadratic drag.

    With U_s the steady speed of the thrust (proportional to it: SPD_CRUISE_MPS at THR_CRUISE_PCT)
    and L = SPD_LENGTH_M, explicit Euler::

        U' = (U_s |U_s| - U |U|) / L

    A step that would pass U_s ends there: with long steps or high speed it would diverge.
    """
    cruise_pct = config.cruise_thrust_pct
    steady = config.cruise_speed_mps * 100.0 * thrust / cruise_pct if cruise_pct else 0.0
    change = (steady * abs(steady) - speed_mps * abs(speed_mps)) / config.speed_length_m * dt_s
    if abs(change) > abs(steady - speed_mps):
        return steady
    return speed_mps + change


@numeric
def _attitude(
    old: VehicleEstimate, sensors: SensorFrame, speed_mps: float, config: Config, dt_s: float
) -> tuple[Quaternion, Vector, Vector, Vector]:
    """Return attitude, body rates (rad/s), gyro bias (rad/s) and e_a + e_m (rad) after a tick.

    The last is NaN unless accelerometer and magnetometer are used.

    Mahony, Hamel and Pflimlin 2008, eq. 32, with e_a and e_m the rotation errors of accelerometer
    and magnetometer (rad, body axes), b' limited to MAX_BIAS_RADPS::

        R' = R [w - b + k_a e_a + k_m e_m]_x        b' = -k_b (e_a + e_m)

    k_a = EST_ATT_GAIN, k_m = EST_HDG_GAIN, k_b = EST_BIAS_GAIN, each times the weight
    1 / (1 + (q^2 + r^2) / TURN_RATE_GATE^2).
    """
    if sensors.fields_updated & GYRO_FRESH == 0:
        return _attitude_without_gyro(old, sensors, speed_mps, config, dt_s)
    bx, by, bz = old.gyro_bias_radps
    p, q, r = sensors[4:7]
    p, q, r = p - bx, q - by, r - bz
    (ex, ey, ez), (mx, my, mz) = attitude_errors(old.attitude, sensors, speed_mps, q, r, config)
    weight = 1.0 / (1.0 + (q * q + r * r) / (TURN_RATE_GATE_RADPS * TURN_RATE_GATE_RADPS))
    ka, kh, kb = (
        weight * config.attitude_gain,
        weight * config.heading_gain,
        weight * config.bias_gain,
    )
    attitude = _integrate(
        old.attitude, p + ka * ex + kh * mx, q + ka * ey + kh * my, r + ka * ez + kh * mz, dt_s
    )
    bias = (
        _clip_bias(bx - kb * (ex + mx) * dt_s),
        _clip_bias(by - kb * (ey + my) * dt_s),
        _clip_bias(bz - kb * (ez + mz) * dt_s),
    )
    error = ex + mx, ey + my, ez + mz
    if sensors.fields_updated & ATTITUDE_FRESH != ATTITUDE_FRESH:
        error = _UNKNOWN
    return attitude, (p, q, r), bias, error


@numeric
def _attitude_without_gyro(
    old: VehicleEstimate, sensors: SensorFrame, speed_mps: float, config: Config, dt_s: float
) -> tuple[Quaternion, Vector, Vector, Vector]:
    """Return attitude, rates, bias and an unknown error, without the gyro; the bias is unchanged.

    Second-order observer with a double pole a = RATE_OBSERVER_RADPS and e = e_a + e_m::

        R' = R [w + 2 a e]_x        w' = a^2 e

    Above ATTITUDE_RESTART_RAD the attitude is rotated by e, and w is set to 0.
    """
    p, q, r = old.p_radps, old.q_radps, old.r_radps
    (ex, ey, ez), (mx, my, mz) = attitude_errors(old.attitude, sensors, speed_mps, q, r, config)
    ex, ey, ez = ex + mx, ey + my, ez + mz
    if ex * ex + ey * ey + ez * ez > ATTITUDE_RESTART_RAD * ATTITUDE_RESTART_RAD:
        turned = _integrate(old.attitude, ex, ey, ez, 1.0)
        return turned, (0.0, 0.0, 0.0), old.gyro_bias_radps, _UNKNOWN
    angle_gain, rate_gain = (
        2.0 * RATE_OBSERVER_RADPS,
        RATE_OBSERVER_RADPS * RATE_OBSERVER_RADPS * dt_s,
    )
    attitude = _integrate(
        old.attitude, p + angle_gain * ex, q + angle_gain * ey, r + angle_gain * ez, dt_s
    )
    return (
        attitude,
        (p + rate_gain * ex, q + rate_gain * ey, r + rate_gain * ez),
        old.gyro_bias_radps,
        _UNKNOWN,
    )


@numeric
def _down_vector(attitude: Quaternion) -> Vector:
    """Return the unit vector down (NED) in body axes."""
    w, x, y, z = attitude
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@numeric
def attitude_errors(
    attitude: Quaternion,
    sensors: SensorFrame,
    speed_mps: float,
    q_radps: float,
    r_radps: float,
    config: Config,
) -> tuple[Vector, Vector]:
    """Return e_a and e_m: rotation errors (rad, body axes) to gravity and to magnetic north.

    Parameters
    ----------
    attitude : Quaternion
        Estimated attitude.
    sensors : SensorFrame
        Sensor frame, checked.
    speed_mps, q_radps, r_radps : float
        Forward speed, pitch rate and yaw rate.
    config : Config
        Parameter MAG_DECL_DEG.

    Returns
    -------
    tuple of 2 vectors
        Zero for a sensor that is not fresh.
    """
    down = _down_vector(attitude)
    x, y, z = down
    heading_error = _heading_error(attitude, sensors, config)
    return _tilt_error(down, sensors, speed_mps, q_radps, r_radps), (
        heading_error * x,
        heading_error * y,
        heading_error * z,
    )


@numeric
def _tilt_error(
    down: Vector, sensors: SensorFrame, speed_mps: float, q_radps: float, r_radps: float
) -> Vector:
    """Return the rotation (rad, body axes) from the estimated to the measured down; 0 if unknown.

    The measured down is -(f - w x U) = -f + (0, r U, -q U), normalised; e_a is its cross product
    with d. It is not used below half the standard gravity.
    """
    if sensors.fields_updated & ACCELEROMETER_FRESH == 0:
        return 0.0, 0.0, 0.0
    fx, fy, fz = sensors[1:4]
    ax, ay, az = -fx, -fy + r_radps * speed_mps, -fz - q_radps * speed_mps
    norm = math.sqrt(ax * ax + ay * ay + az * az)
    if norm < 0.5 * STANDARD_GRAVITY_MPS2:
        return 0.0, 0.0, 0.0
    dx, dy, dz = down
    return (ay * dz - az * dy) / norm, (az * dx - ax * dz) / norm, (ax * dy - ay * dx) / norm


@numeric
def _heading_error(attitude: Quaternion, sensors: SensorFrame, config: Config) -> float:
    """Return the rotation about down (rad) that turns the measured field to magnetic north.

    The result is 0 without a magnetometer reading.
    """
    if sensors.fields_updated & MAGNETOMETER_FRESH == 0:
        return 0.0
    north, east, _ = rotate(attitude, sensors[7:10])
    if north == 0.0 and east == 0.0:
        return 0.0
    return wrap_pi(config.declination_rad - math.atan2(east, north))


@numeric
def _integrate(attitude: Quaternion, p: float, q: float, r: float, dt_s: float) -> Quaternion:
    """Integrate body rates (rad/s): q' = q (0, p, q, r) / 2, explicit Euler, then normalise."""
    w, x, y, z = attitude
    h = 0.5 * dt_s
    nw = w - h * (x * p + y * q + z * r)
    nx = x + h * (w * p + y * r - z * q)
    ny = y + h * (w * q + z * p - x * r)
    nz = z + h * (w * r + x * q - y * p)
    norm = 1.0 / math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    return nw * norm, nx * norm, ny * norm, nz * norm


@numeric
def _clip_bias(bias_radps: float) -> float:
    """Limit a gyro bias to +-MAX_BIAS_RADPS."""
    return (
        bias_radps
        if -MAX_BIAS_RADPS < bias_radps < MAX_BIAS_RADPS
        else math.copysign(MAX_BIAS_RADPS, bias_radps)
    )


@numeric
def _has_new_depth(fields_updated: int) -> bool:
    """Return whether a checked frame has a new pressure, and not the last one again."""
    return fields_updated & PRESSURE_FRESH != 0 and fields_updated & PRESSURE_HELD == 0


@numeric
def _depth(
    old: VehicleEstimate, sensors: SensorFrame, attitude: Quaternion, config: Config, dt_s: float
) -> tuple[float, float, float]:
    """Return depth (m), depth rate (m/s) and bias of the downward acceleration (m/s^2).

    With a = d . f + g - b the downward acceleration, e = z_measured - z_predicted and the triple
    pole w = 1 / EST_DPT_TIME::

        z <- z + v dt + a dt^2 / 2 + 3 w e dt
        v <- v + (a + 3 w^2 e) dt
        b <- b - w^3 e dt

    Without a new pressure: z' = v, v' = a - v / DEPTH_RATE_DECAY_S, b constant. A reading after
    a time T of that corrects as a fading-memory filter of second degree (E. Brookner, "Tracking
    and Kalman Filtering Made Easy", 1998, chapter 7), which has the same poles, with
    theta = exp(-w T)::

        z <- z + (1 - theta^3) e
        v <- v + 3/2 (1 - theta)^2 (1 + theta) e / T
        b <- b - (1 - theta)^3 e / T^2

    After DEPTH_RESTART_US the measured depth replaces z, and v changes by the mean error of the
    vertical speed, e / T, if that is less than MAX_RATE_CORRECTION_MPS.
    """
    rate_mps, bias_mps2, down_mps2 = old.depth_rate_mps, old.accel_bias_mps2, 0.0
    fresh = sensors.fields_updated
    if fresh & ACCELEROMETER_FRESH != 0:
        (x, y, z), (ax, ay, az) = _down_vector(attitude), sensors[1:4]
        down_mps2 = x * ax + y * ay + z * az + STANDARD_GRAVITY_MPS2 - bias_mps2
    if not _has_new_depth(fresh):
        decay = -rate_mps / DEPTH_RATE_DECAY_S
        return old.depth_m + rate_mps * dt_s, rate_mps + (down_mps2 + decay) * dt_s, bias_mps2
    measured_m = depth_of(sensors.pressure_hpa, config)
    unmeasured_s = (sensors.time_us - old.depth_time_us) / US_PER_S
    if unmeasured_s * US_PER_S > DEPTH_RESTART_US:
        mean_error_mps = (measured_m - old.depth_m) / unmeasured_s
        if abs(mean_error_mps) < MAX_RATE_CORRECTION_MPS:
            rate_mps += mean_error_mps
        return measured_m, rate_mps + down_mps2 * dt_s, bias_mps2
    pole = 1.0 / config.depth_time_s
    depth = old.depth_m + rate_mps * dt_s + 0.5 * down_mps2 * dt_s * dt_s
    error = measured_m - depth
    if unmeasured_s > 1.5 * dt_s:
        theta = math.exp(-pole * unmeasured_s)
        rest = 1.0 - theta
        return (
            depth + (1.0 - theta * theta * theta) * error,
            rate_mps + down_mps2 * dt_s + 1.5 * rest * rest * (1.0 + theta) * error / unmeasured_s,
            bias_mps2 - rest * rest * rest * error / (unmeasured_s * unmeasured_s),
        )
    return (
        depth + 3.0 * pole * error * dt_s,
        rate_mps + (down_mps2 + 3.0 * pole * pole * error) * dt_s,
        bias_mps2 - pole * pole * pole * error * dt_s,
    )
