"""Messages of the numbers of one tick, which compiled code builds too."""

import math

from autopilot.control import actuator_test
from autopilot.control.types import Home, Motion, VehicleEstimate
from autopilot.telemetry.encoding import (
    Report,
    boot_ms,
    centidegrees,
    clamp,
    int16,
    int32,
    time_us,
)
from mavlink_io.device_messages import UNKNOWN_U16
from mavlink_io.dialect import Values, constant
from mavlink_io.frames import offset_to_geodetic, quaternion_from_euler, rotate_back
from mavlink_io.jit import numeric

ACTUATORS_IN_USE = (1 << actuator_test.CHANNELS) - 1
"""ACTUATOR_OUTPUT_STATUS.active: a bit per channel."""
_ATTITUDE_TARGET_IGNORES = 0b111
"""ATTITUDE_TARGET.type_mask: the body rates are ignored."""
_LOOKING_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")
_ULTRASOUND = constant("MAV_DISTANCE_SENSOR_ULTRASOUND")
_GLOBAL_NED, _CHILD_FRD = constant("MAV_FRAME_LOCAL_NED"), constant("MAV_FRAME_BODY_FRD")
DEPTH_SD_M, _TILT_SD_RAD, _HEADING_SD_RAD = 0.1, math.radians(0.5), math.radians(1.0)
"""Assumed standard deviations of depth, roll and pitch, and heading; they are not estimated."""


@numeric
def attitude(s: Report) -> Values:
    """Return ATTITUDE: Euler angles (rad) and body rates (rad/s)."""
    m = s.motion
    angles, rates = (m.roll_rad, m.pitch_rad, m.heading_rad), (m.p_radps, m.q_radps, m.r_radps)
    return boot_ms(s), *angles, *rates


@numeric
def attitude_quaternion(s: Report) -> Values:
    """Return ATTITUDE_QUATERNION: attitude (w, x, y, z) and body rates (rad/s)."""
    m = s.motion
    quaternion = m.attitude_w, m.attitude_x, m.attitude_y, m.attitude_z
    return boot_ms(s), *quaternion, m.p_radps, m.q_radps, m.r_radps, (0.0,) * 4


@numeric
def local_position(s: Report) -> Values:
    """Return LOCAL_POSITION_NED: position (m) and velocity over ground (m/s)."""
    m = s.motion
    velocity = m.north_rate_mps, m.east_rate_mps, m.depth_rate_mps
    return boot_ms(s), m.north_m, m.east_m, m.depth_m, *velocity


@numeric
def global_position(s: Report) -> Values:
    """Return GLOBAL_POSITION_INT: degE7, mm, cm/s and cdeg."""
    motion = s.motion
    lat, lon = position_dege7(motion, s.home)
    height_mm = int32(-motion.depth_m * 1000.0)
    return (
        boot_ms(s),
        lat,
        lon,
        height_mm,
        height_mm,
        int16(motion.north_rate_mps * 100.0),
        int16(motion.east_rate_mps * 100.0),
        int16(motion.depth_rate_mps * 100.0),
        centidegrees(motion.heading_rad),
    )


@numeric
def position_dege7(at: VehicleEstimate | Motion, home: Home) -> tuple[int, int]:
    """Return the estimated latitude and longitude in degE7; 0, 0 while home is not known.

    Parameters
    ----------
    at : VehicleEstimate or Motion
        Estimated motion.
    home : Home
        Origin of its position.
    """
    if not home.known:
        return 0, 0
    lat, lon = offset_to_geodetic(at.north_m, at.east_m, home.lat_deg, home.lon_deg)
    return int32(lat * 1e7), int32(lon * 1e7)


@numeric
def vfr_hud(s: Report) -> Values:
    """Return VFR_HUD: speeds (m/s), altitude (m), heading (deg) and thrust (percent)."""
    motion = s.motion
    north_mps, east_mps = motion.north_rate_mps, motion.east_rate_mps
    throttle = clamp(abs(s.trace.thrust) * 100.0, 0, 100)
    return (
        motion.speed_mps,
        math.sqrt(north_mps * north_mps + east_mps * east_mps),
        -motion.depth_m,
        -motion.depth_rate_mps,
        centidegrees(motion.heading_rad) // 100,
        throttle,
    )


@numeric
def distance_sensor(s: Report) -> Values:
    """Return DISTANCE_SENSOR: range (cm) of the altimeter; signal quality 1 means no echo."""
    range_m, altimeter = s.motion.altitude_m, s.altimeter
    nearest_m, farthest_m = 0.0, math.inf
    if altimeter is not None:
        nearest_m, farthest_m = altimeter.min_range_m, altimeter.max_range_m
    no_echo = math.isnan(range_m)
    return (
        boot_ms(s),
        clamp(100.0 * nearest_m, 0, UNKNOWN_U16),
        clamp(100.0 * farthest_m, 0, UNKNOWN_U16),
        clamp(100.0 * (0.0 if no_echo else range_m), 0, UNKNOWN_U16),
        _ULTRASOUND,
        0,
        _LOOKING_DOWN,
        255,
        0.0,
        0.0,
        (0.0,) * 4,
        1 if no_echo else 100,
    )


@numeric
def system_time(s: Report) -> Values:
    """Return SYSTEM_TIME with vehicle time (ms) only: the time of day is not known."""
    return 0, boot_ms(s)


@numeric
def altitude(s: Report) -> Values:
    """Return ALTITUDE: m above the surface, and above the sea floor; -1 when unknown."""
    motion = s.motion
    height_m = -motion.depth_m
    clearance_m = -1.0 if math.isnan(motion.altitude_m) else motion.altitude_m
    return time_us(s), height_m, height_m, height_m, height_m, -2000.0, clearance_m


@numeric
def water_pressure(s: Report) -> Values:
    """Return SCALED_PRESSURE2: absolute pressure (hPa) and temperature (cdegC)."""
    if s.sensors is None:
        return boot_ms(s), 0.0, 0.0, 0, 0
    return boot_ms(s), s.sensors.pressure_hpa, 0.0, int16(s.sensors.temperature_degc * 100.0), 0


@numeric
def attitude_target(s: Report) -> Values:
    """Return ATTITUDE_TARGET: pitch and heading set-points as a quaternion, and thrust."""
    target = quaternion_from_euler(0.0, s.trace.pitch_setpoint_rad, s.setpoint.heading_rad)
    return boot_ms(s), target, 0.0, 0.0, 0.0, s.trace.thrust, _ATTITUDE_TARGET_IGNORES


@numeric
def servo_outputs(s: Report) -> Values:
    """Return SERVO_OUTPUT_RAW: commands of -1..1 as pulse widths of 1100..1900 us."""
    rudder, elevator, thrust = s.actuators.controls[: actuator_test.CHANNELS]
    pulses_us = _pulse_us(rudder), _pulse_us(elevator), _pulse_us(thrust)
    return time_us(s) & 0xFFFF_FFFF, *pulses_us, *_NO_PULSES, 0, *(0,) * 8


_NO_PULSES = (0,) * (8 - actuator_test.CHANNELS)


@numeric
def _pulse_us(command: float) -> int:
    """Return the pulse width of a command."""
    return clamp(1500.0 + 400.0 * command, 1100, 1900)


@numeric
def actuator_outputs(s: Report) -> Values:
    """Return ACTUATOR_OUTPUT_STATUS: commands of -1..1."""
    return time_us(s), ACTUATORS_IN_USE, s.actuators.controls + (0.0,) * 16


@numeric
def imu(s: Report) -> Values:
    """Return HIGHRES_IMU with the fields of the newest HIL_SENSOR."""
    f = s.sensors
    if f is None:
        return time_us(s), *(0.0,) * 13, 0, 0
    return (
        f.time_us,
        f.accel_x_mps2,
        f.accel_y_mps2,
        f.accel_z_mps2,
        f.gyro_x_radps,
        f.gyro_y_radps,
        f.gyro_z_radps,
        f.mag_x_gauss,
        f.mag_y_gauss,
        f.mag_z_gauss,
        f.pressure_hpa,
        f.differential_pressure_hpa,
        f.pressure_altitude_m,
        f.temperature_degc,
        f.fields_updated & 0xFFFF,
        0,
    )


@numeric
def odometry(s: Report) -> Values:
    """Return ODOMETRY: position in NED (m), velocity over ground in body axes (m/s)."""
    m = s.motion
    attitude = m.attitude_w, m.attitude_x, m.attitude_y, m.attitude_z
    velocity = rotate_back(attitude, (m.north_rate_mps, m.east_rate_mps, m.depth_rate_mps))
    pose = _diagonal(
        m.position_sd_m,
        m.position_sd_m,
        DEPTH_SD_M,
        _TILT_SD_RAD,
        _TILT_SD_RAD,
        _HEADING_SD_RAD,
    )
    speed_sd_mps = m.velocity_sd_mps
    rates = _diagonal(speed_sd_mps, speed_sd_mps, speed_sd_mps, math.nan, math.nan, math.nan)
    return (
        time_us(s),
        m.north_m,
        m.east_m,
        m.depth_m,
        attitude,
        *velocity,
        m.p_radps,
        m.q_radps,
        m.r_radps,
        pose,
        rates,
        _GLOBAL_NED,
        _CHILD_FRD,
        0,
        0,
        0,
    )


@numeric
def _diagonal(*sds: float) -> tuple[float, ...]:
    """Return the upper triangle, row by row, of a diagonal 6 x 6 covariance."""
    x, y, z, roll, pitch, yaw = sds
    return (
        *(x * x, 0.0, 0.0, 0.0, 0.0, 0.0),
        *(y * y, 0.0, 0.0, 0.0, 0.0),
        *(z * z, 0.0, 0.0, 0.0),
        *(roll * roll, 0.0, 0.0),
        *(pitch * pitch, 0.0),
        yaw * yaw,
    )
