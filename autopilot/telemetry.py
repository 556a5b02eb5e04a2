"""The one table of telemetry: each message, how often by default, and how it is made of a snapshot.

Due by vehicle time, in whole ticks and at a fixed phase, so that identical flights give identical bytes.
Builders return a message's fields in wire order; integers are clamped to their field.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot import health, identity
from autopilot.devices import ALTIMETER, BATTERY, DUCT, DVL, GPS
from autopilot.types import State
from autopilot.vehicle import Snapshot, progress
from link import devices, dialect
from link.devices import UNKNOWN_U16
from link.dialect import MessageType, constant
from link.frames import offset_to_geodetic, quaternion_from_euler
from link.records import Battery

Values = tuple[Any, ...]
Builder = Callable[[Snapshot], Values]

_GLOBAL_NED, _CHILD_FRD = constant("MAV_FRAME_LOCAL_NED"), constant("MAV_FRAME_BODY_FRD")
_LOOKING_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")
_ULTRASOUND = constant("MAV_DISTANCE_SENSOR_ULTRASOUND")
_NO_FIX = constant("GPS_FIX_TYPE_NO_FIX")
_SURFACED, _UNDER_WAY = constant("MAV_LANDED_STATE_ON_GROUND"), constant("MAV_LANDED_STATE_IN_AIR")
_ACTUATORS = 3
_ACTUATORS_IN_USE = (1 << _ACTUATORS) - 1
_NO_COVARIANCE = (math.nan,) + (0.0,) * 20

_ATTITUDE_TARGET_IGNORES = 0b111
"""ATTITUDE_TARGET.type_mask: the body rates."""
_POSITION_TARGET_IGNORES = 0b1001_1111_1011
"""POSITION_TARGET_TYPEMASK: all but z and yaw."""

_SENSORS = sum(
    constant(f"MAV_SYS_STATUS_SENSOR_{name}")
    for name in ("3D_GYRO", "3D_ACCEL", "3D_MAG", "ABSOLUTE_PRESSURE", "GPS", "MOTOR_OUTPUTS")
)
_CONTROLS = sum(
    constant(f"MAV_SYS_STATUS_SENSOR_{name}")
    for name in ("ANGULAR_RATE_CONTROL", "ATTITUDE_STABILIZATION", "YAW_POSITION", "Z_ALTITUDE_CONTROL")
)
_PREARM = constant("MAV_SYS_STATUS_PREARM_CHECK")
_BITS = {
    name: constant(f"MAV_SYS_STATUS_{bit}")
    for name, bit in {
        health.ACCELEROMETER: "SENSOR_3D_ACCEL",
        health.GYRO: "SENSOR_3D_GYRO",
        health.MAGNETOMETER: "SENSOR_3D_MAG",
        health.PRESSURE: "SENSOR_ABSOLUTE_PRESSURE",
        GPS: "SENSOR_GPS",
        ALTIMETER: "SENSOR_LASER_POSITION",
        DVL: "SENSOR_VISION_POSITION",
        BATTERY: "SENSOR_BATTERY",
        DUCT: "SENSOR_MOTOR_OUTPUTS",
        health.DEPTH: "SENSOR_Z_ALTITUDE_CONTROL",
    }.items()
}
"""Where SYS_STATUS shows what: the altimeter as rangefinders are, the Doppler log as what else tells velocity."""
_GEOFENCE = constant("MAV_SYS_STATUS_GEOFENCE")
"""Healthy always, or MAVProxy announces a breach of a fence that does not exist."""


def attitude(s: Snapshot) -> Values:
    at = s.state.estimate
    return _boot_ms(s), at.roll_rad, at.pitch_rad, at.heading_rad, at.p_radps, at.q_radps, at.r_radps


def attitude_quaternion(s: Snapshot) -> Values:
    at = s.state.estimate
    return _boot_ms(s), *at.attitude, at.p_radps, at.q_radps, at.r_radps, (0.0,) * 4


def local_position(s: Snapshot) -> Values:
    at = s.state.estimate
    return _boot_ms(s), at.north_m, at.east_m, at.depth_m, at.north_rate_mps, at.east_rate_mps, at.depth_rate_mps


def global_position(s: Snapshot) -> Values:
    at = s.state.estimate
    lat, lon = position_dege7(s.state)
    height_mm = _int32(-at.depth_m * 1000.0)
    vx, vy, vz = (_int16(v * 100.0) for v in (at.north_rate_mps, at.east_rate_mps, at.depth_rate_mps))
    return _boot_ms(s), lat, lon, height_mm, height_mm, vx, vy, vz, round(_heading_deg(s) * 100.0) % 36_000


def vfr_hud(s: Snapshot) -> Values:
    at = s.state.estimate
    over_ground = math.hypot(at.north_rate_mps, at.east_rate_mps)
    throttle = min(100, round(abs(s.trace.thrust) * 100.0))
    return at.speed_mps, over_ground, -at.depth_m, -at.depth_rate_mps, round(_heading_deg(s)) % 360, throttle


def altitude(s: Snapshot) -> Values:
    at = s.state.estimate
    height, clearance = -at.depth_m, -1.0 if at.altitude_m is None else at.altitude_m
    return _time_us(s), height, height, height, height, -2000.0, clearance


def water_pressure(s: Snapshot) -> Values:
    if s.sensors is None:
        return _boot_ms(s), 0.0, 0.0, 0, 0
    return _boot_ms(s), s.sensors.pressure_hpa, 0.0, _int16(s.sensors.temperature_degc * 100.0), 0


def distance_sensor(s: Snapshot) -> Values:
    """Within the limits of the altimeter that is fitted; quality 1 says that it sees no floor."""
    range_m, fitted = s.state.estimate.altitude_m, s.altimeter
    least_cm, most_cm = (0, UNKNOWN_U16) if fitted is None else (_cm(fitted.min_range_m), _cm(fitted.max_range_m))
    reading_cm, quality = (0, 1) if range_m is None else (_cm(range_m), 100)
    return _boot_ms(s), least_cm, most_cm, reading_cm, _ULTRASOUND, 0, _LOOKING_DOWN, 255, 0.0, 0.0, (0.0,) * 4, quality


def navigation(s: Snapshot) -> Values:
    wanted = s.state.setpoint
    bearing = round(math.degrees(wanted.heading_rad))
    return 0.0, math.degrees(s.trace.pitch_setpoint_rad), -s.trace.depth_error_m, 0.0, 0.0, bearing, bearing, 0


def attitude_target(s: Snapshot) -> Values:
    wanted = quaternion_from_euler(0.0, s.trace.pitch_setpoint_rad, s.state.setpoint.heading_rad)
    return _boot_ms(s), wanted, 0.0, 0.0, 0.0, s.trace.thrust, _ATTITUDE_TARGET_IGNORES


def position_target(s: Snapshot) -> Values:
    wanted = s.state.setpoint
    rest = (0.0,) * 6
    return (
        _boot_ms(s), 0.0, 0.0, wanted.depth_m, *rest, wanted.heading_rad, 0.0, _POSITION_TARGET_IGNORES, _GLOBAL_NED,
    )  # fmt: skip


def servo_outputs(s: Snapshot) -> Values:
    pulses_us = [round(1500.0 + 400.0 * c) for c in s.actuators.controls[:_ACTUATORS]]
    return _time_us(s) & 0xFFFF_FFFF, *pulses_us, *(0,) * (8 - _ACTUATORS), 0, *(0,) * 8


def actuator_outputs(s: Snapshot) -> Values:
    return _time_us(s), _ACTUATORS_IN_USE, s.actuators.controls + (0.0,) * 16


def imu(s: Snapshot) -> Values:
    if s.sensors is None:
        return _time_us(s), *(0.0,) * 13, 0, 0
    return *s.sensors[:14], s.sensors.fields_updated & 0xFFFF, 0


def odometry(s: Snapshot) -> Values:
    at = s.state.estimate
    return (
        _time_us(s), at.north_m, at.east_m, at.depth_m, at.attitude, at.speed_mps, 0.0, 0.0,
        at.p_radps, at.q_radps, at.r_radps, (at.position_sd_m**2, *(0.0,) * 5, at.position_sd_m**2, *(0.0,) * 14),
        _NO_COVARIANCE, _GLOBAL_NED, _CHILD_FRD, 0, 0, 0,
    )  # fmt: skip


def gps_raw(s: Snapshot) -> Values:
    fix, unknown = s.fix, UNKNOWN_U16
    if fix is None:
        return _time_us(s), 0, 0, 0, unknown, unknown, unknown, unknown, _NO_FIX, 0, 0, 0, 0, 0, 0, 0
    lat, lon = round(fix.lat_deg * 1e7), round(fix.lon_deg * 1e7)
    speed = min(unknown, round(math.hypot(fix.velocity_north_mps, fix.velocity_east_mps) * 100.0))
    sd_mm, vertical_sd_mm = (0 if math.isnan(sd_m) else round(sd_m * 1000.0) for sd_m in (fix.eph_m, fix.epv_m))
    return (
        fix.time_us, lat, lon, _int32(fix.alt_m * 1000.0), unknown, unknown, speed, unknown,
        fix.fix_type, fix.satellites, 0, sd_mm, vertical_sd_mm, 0, 0, 0,
    )  # fmt: skip


def system_time(s: Snapshot) -> Values:
    """The time of day is not known on board: vehicle time only."""
    return 0, _boot_ms(s)


def system_status(s: Snapshot) -> Values:
    """GPS counts as healthy under water too: it means that the position is known, or no client ever arms."""
    sensors = _SENSORS if s.state.estimate.initialised else 0
    seen = s.state.health
    extra = _carried(s) | (devices.EXTENSION_USED if s.leak else 0)
    present = _SENSORS | _CONTROLS | _PREARM | extra
    ready = _PREARM if s.state.estimate.initialised and not health.refusal(seen) else 0
    enabled = _SENSORS | _PREARM | (_CONTROLS if s.state.armed else 0) | extra
    wrong = sum(_BITS.get(name, 0) for name in health.troubles(seen))
    sound = (sensors | _CONTROLS | _GEOFENCE | ready | extra) & ~wrong
    fitted = devices.LEAK_BIT if s.leak else 0
    dry = fitted if s.leak and not s.leak.wet else 0
    return present, enabled, sound, 0, *_power(s.battery), *(0,) * 6, _percent(s.battery), fitted, fitted, dry


def _carried(s: Snapshot) -> int:
    """The bits of devices that a vehicle may or may not carry."""
    further = (BATTERY, s.battery), (ALTIMETER, s.altimeter), (DVL, s.state.health.dvl.record)
    return sum(_BITS[name] for name, heard in further if heard is not None)


def battery(s: Snapshot) -> Values:
    """What the gauge says; without one every field says unknown."""
    if s.battery is None:
        unknown = (UNKNOWN_U16,) * 10
        return -1, -1, devices.UNKNOWN_TEMPERATURE, unknown, -1, 0, 1, 0, -1, 0, 0, (0,) * 4, 0, 0
    return devices.battery_values(s.battery)


def extended_state(s: Snapshot) -> Values:
    afloat = not s.state.armed and s.state.estimate.depth_m < s.config.surfaced_depth_m
    return 0, _SURFACED if afloat else _UNDER_WAY


def mission_current(s: Snapshot) -> Values:
    return progress(s.state)


def current_mode(s: Snapshot) -> Values:
    return identity.current_mode(s.state, s.intended_mode)


def home_position(s: Snapshot) -> Values:
    """Home lies at the surface: altitude zero, whatever the satellite says."""
    home = s.state.home
    level, origin, approach = (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3
    return round(home.lat_deg * 1e7), round(home.lon_deg * 1e7), 0, *origin, level, *approach, _time_us(s)


class Stream(NamedTuple):
    """One row of the table."""

    message: MessageType
    rate_hz: float
    build: Builder


def _stream(name: str, rate_hz: float, build: Builder) -> Stream:
    return Stream(dialect.by_name(name), rate_hz, build)


STREAMS = (
    _stream("ATTITUDE", 10, attitude),
    _stream("ATTITUDE_QUATERNION", 10, attitude_quaternion),
    _stream("LOCAL_POSITION_NED", 5, local_position),
    _stream("GLOBAL_POSITION_INT", 5, global_position),
    _stream("VFR_HUD", 4, vfr_hud),
    _stream("ALTITUDE", 2, altitude),
    _stream("SCALED_PRESSURE2", 5, water_pressure),
    _stream("DISTANCE_SENSOR", 5, distance_sensor),
    _stream("NAV_CONTROLLER_OUTPUT", 2, navigation),
    _stream("ATTITUDE_TARGET", 4, attitude_target),
    _stream("POSITION_TARGET_LOCAL_NED", 2, position_target),
    _stream("SERVO_OUTPUT_RAW", 4, servo_outputs),
    _stream("ACTUATOR_OUTPUT_STATUS", 4, actuator_outputs),
    _stream("HIGHRES_IMU", 10, imu),
    _stream("ODOMETRY", 5, odometry),
    _stream("GPS_RAW_INT", 1, gps_raw),
    _stream("SYSTEM_TIME", 1, system_time),
    _stream("SYS_STATUS", 1, system_status),
    _stream("EXTENDED_SYS_STATE", 1, extended_state),
    _stream("MISSION_CURRENT", 1, mission_current),
    _stream("CURRENT_MODE", 0.5, current_mode),
    _stream("BATTERY_STATUS", 0.5, battery),
    _stream("HOME_POSITION", 0.2, home_position),
)
BY_ID = {stream.message.message_id: stream for stream in STREAMS}


def position_dege7(state: State) -> tuple[int, int]:
    """Latitude and longitude by dead reckoning; zero while home is not known."""
    if not state.home.known:
        return 0, 0
    at = state.estimate
    lat, lon = offset_to_geodetic(at.north_m, at.east_m, state.home.lat_deg, state.home.lon_deg)
    return round(lat * 1e7), round(lon * 1e7)


def _time_us(s: Snapshot) -> int:
    return max(0, s.state.time_us)


def _boot_ms(s: Snapshot) -> int:
    return max(0, s.state.time_us) // 1000 & 0xFFFF_FFFF


def _heading_deg(s: Snapshot) -> float:
    return math.degrees(s.state.estimate.heading_rad) % 360.0


def _cm(metres: float) -> int:
    return max(0, min(UNKNOWN_U16, round(metres * 100.0)))


def _power(battery: Battery | None) -> tuple[int, int]:
    """Voltage in mV and current in cA, as SYS_STATUS has them."""
    if battery is None:
        return UNKNOWN_U16, -1
    return max(0, min(UNKNOWN_U16 - 1, round(battery.voltage_v * 1000.0))), devices.centiamperes(battery.current_a)


def _percent(battery: Battery | None) -> int:
    return -1 if battery is None or math.isnan(battery.remaining) else round(battery.remaining * 100.0)


def _int16(value: float) -> int:
    return max(-32_768, min(32_767, round(value)))


def _int32(value: float) -> int:
    return max(-(1 << 31), min((1 << 31) - 1, round(value)))
