"""The one table of telemetry: each message, how often by default, and how it is made of a snapshot.

Due by vehicle time, in whole ticks and at a fixed phase, so that identical flights give identical
bytes. Builders return a message's fields in wire order; integers are clamped to their field."""

import math
from typing import NamedTuple

from autopilot.control import actuator_test
from autopilot.control.types import AutopilotState, Trace
from autopilot.telemetry import navigation, status
from autopilot.telemetry.encoding import (
    Builder,
    boot_ms,
    centidegrees,
    clamp,
    int16,
    int32,
    time_us,
    uint16,
    uint32,
)
from autopilot.vehicle import Snapshot
from mavlink_io import dialect
from mavlink_io.device_messages import UNKNOWN_U16
from mavlink_io.dialect import MessageType, Values, constant
from mavlink_io.frames import offset_to_geodetic, quaternion_from_euler

_LOOKING_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")
_ULTRASOUND = constant("MAV_DISTANCE_SENSOR_ULTRASOUND")
_NO_FIX = constant("GPS_FIX_TYPE_NO_FIX")
ACTUATORS_IN_USE = (1 << actuator_test.CHANNELS) - 1

_ATTITUDE_TARGET_IGNORES = 0b111
"""ATTITUDE_TARGET.type_mask: the body rates."""


def attitude(s: Snapshot) -> Values:
    at = s.state.estimate
    return boot_ms(s), at.roll_rad, at.pitch_rad, at.heading_rad, at.p_radps, at.q_radps, at.r_radps


def attitude_quaternion(s: Snapshot) -> Values:
    at = s.state.estimate
    return boot_ms(s), *at.attitude, at.p_radps, at.q_radps, at.r_radps, (0.0,) * 4


def local_position(s: Snapshot) -> Values:
    at = s.state.estimate
    return (
        boot_ms(s),
        at.north_m,
        at.east_m,
        at.depth_m,
        at.north_rate_mps,
        at.east_rate_mps,
        at.depth_rate_mps,
    )


def global_position(s: Snapshot) -> Values:
    at = s.state.estimate
    lat, lon = position_dege7(s.state)
    height_mm = int32(-at.depth_m * 1000.0)
    vx, vy, vz = (
        int16(v * 100.0) for v in (at.north_rate_mps, at.east_rate_mps, at.depth_rate_mps)
    )
    return boot_ms(s), lat, lon, height_mm, height_mm, vx, vy, vz, centidegrees(at.heading_rad)


def vfr_hud(s: Snapshot) -> Values:
    at = s.state.estimate
    over_ground = math.hypot(at.north_rate_mps, at.east_rate_mps)
    throttle = clamp(abs(s.trace.thrust) * 100.0, 0, 100)
    return (
        at.speed_mps,
        over_ground,
        -at.depth_m,
        -at.depth_rate_mps,
        centidegrees(at.heading_rad) // 100,
        throttle,
    )


def altitude(s: Snapshot) -> Values:
    at = s.state.estimate
    height, clearance = -at.depth_m, -1.0 if at.altitude_m is None else at.altitude_m
    return time_us(s), height, height, height, height, -2000.0, clearance


def water_pressure(s: Snapshot) -> Values:
    if s.sensors is None:
        return boot_ms(s), 0.0, 0.0, 0, 0
    return boot_ms(s), s.sensors.pressure_hpa, 0.0, int16(s.sensors.temperature_degc * 100.0), 0


def distance_sensor(s: Snapshot) -> Values:
    """Within the limits of the altimeter that is fitted; quality 1 says that it sees no floor."""
    range_m, fitted = s.state.estimate.altitude_m, s.altimeter
    reach_m = (0.0, math.inf) if fitted is None else (fitted.min_range_m, fitted.max_range_m)
    least_cm, most_cm, reading_cm = (
        clamp(100.0 * m, 0, UNKNOWN_U16) for m in (*reach_m, range_m or 0.0)
    )
    quality = 1 if range_m is None else 100
    return (
        boot_ms(s),
        least_cm,
        most_cm,
        reading_cm,
        _ULTRASOUND,
        0,
        _LOOKING_DOWN,
        255,
        0.0,
        0.0,
        (0.0,) * 4,
        quality,
    )


def attitude_target(s: Snapshot) -> Values:
    wanted = quaternion_from_euler(0.0, s.trace.pitch_setpoint_rad, s.state.setpoint.heading_rad)
    return boot_ms(s), wanted, 0.0, 0.0, 0.0, s.trace.thrust, _ATTITUDE_TARGET_IGNORES


def servo_outputs(s: Snapshot) -> Values:
    pulses_us = [
        clamp(1500.0 + 400.0 * c, 1100, 1900)
        for c in s.actuators.controls[: actuator_test.CHANNELS]
    ]
    return time_us(s) & 0xFFFF_FFFF, *pulses_us, *(0,) * (8 - actuator_test.CHANNELS), 0, *(0,) * 8


def actuator_outputs(s: Snapshot) -> Values:
    return time_us(s), ACTUATORS_IN_USE, s.actuators.controls + (0.0,) * 16


def imu(s: Snapshot) -> Values:
    if s.sensors is None:
        return time_us(s), *(0.0,) * 13, 0, 0
    return *s.sensors[:14], s.sensors.fields_updated & 0xFFFF, 0


def gps_raw(s: Snapshot) -> Values:
    fix, unknown = s.fix, UNKNOWN_U16
    if fix is None:
        return time_us(s), 0, 0, 0, unknown, unknown, unknown, unknown, _NO_FIX, 0, 0, 0, 0, 0, 0, 0
    lat, lon = int32(fix.lat_deg * 1e7), int32(fix.lon_deg * 1e7)
    speed = uint16(math.hypot(fix.velocity_north_mps, fix.velocity_east_mps) * 100.0)
    sd_mm, vertical_sd_mm = (uint32(sd_m * 1000.0) for sd_m in (fix.eph_m, fix.epv_m))
    return (
        fix.time_us,
        lat,
        lon,
        int32(fix.alt_m * 1000.0),
        unknown,
        unknown,
        speed,
        unknown,
        fix.fix_type,
        fix.satellites,
        0,
        sd_mm,
        vertical_sd_mm,
        0,
        0,
        0,
    )


def system_time(s: Snapshot) -> Values:
    """The time of day is not known on board: vehicle time only."""
    return 0, boot_ms(s)


def global_origin(s: Snapshot) -> Values:
    """Where north and east are counted from: home, at the surface."""
    home = s.state.home
    return int32(home.lat_deg * 1e7), int32(home.lon_deg * 1e7), 0, time_us(s)


TRACE_NAME, TRACE_ID = b"TRACE", 1
"""DEBUG_FLOAT_ARRAY's name and number of the loops' inside; ``Trace`` says what each of its numbers
is."""
_TRACE_REST = (0.0,) * (58 - len(Trace._fields))


def loop_trace(s: Snapshot) -> Values:
    return time_us(s), TRACE_ID, TRACE_NAME, (*s.trace, *_TRACE_REST)


NAMED = {
    "DPT_ERR": "depth_error_m",
    "PTCH_ERR": "pitch_error_rad",
    "HDG_ERR": "heading_error_rad",
    "SID_IN": "excitation_rad",
    "SID_FREQ": "excitation_hz",
}
"""Single numbers of the loops' inside, for clients that plot no arrays: NAMED_VALUE_FLOAT's name,
and which it is."""


def _named_value(name: str, place: int) -> Builder:
    return lambda s: (boot_ms(s), s.trace[place], name.encode())


class TelemetryStream(NamedTuple):
    """One row of the table."""

    message: MessageType
    rate_hz: float
    """0: only for who asks."""
    build: Builder
    further: tuple[Builder, ...] = ()
    """For what takes more than one message."""

    @property
    def builders(self) -> tuple[Builder, ...]:
        return self.build, *self.further


def _stream(name: str, rate_hz: float, build: Builder, *further: Builder) -> TelemetryStream:
    return TelemetryStream(dialect.by_name(name), rate_hz, build, further)


STREAMS = (
    _stream("ATTITUDE", 10, attitude),
    _stream("ATTITUDE_QUATERNION", 10, attitude_quaternion),
    _stream("LOCAL_POSITION_NED", 5, local_position),
    _stream("GLOBAL_POSITION_INT", 5, global_position),
    _stream("VFR_HUD", 4, vfr_hud),
    _stream("ALTITUDE", 2, altitude),
    _stream("SCALED_PRESSURE2", 5, water_pressure),
    _stream("DISTANCE_SENSOR", 5, distance_sensor),
    _stream("NAV_CONTROLLER_OUTPUT", 2, navigation.navigation),
    _stream("ATTITUDE_TARGET", 4, attitude_target),
    _stream("POSITION_TARGET_LOCAL_NED", 2, navigation.position_target),
    _stream("SERVO_OUTPUT_RAW", 4, servo_outputs),
    _stream("ACTUATOR_OUTPUT_STATUS", 4, actuator_outputs),
    _stream("HIGHRES_IMU", 10, imu),
    _stream("ODOMETRY", 5, navigation.odometry),
    _stream("ESTIMATOR_STATUS", 1, navigation.estimator_status),
    _stream("WIND_COV", 1, navigation.current),
    _stream("GPS_RAW_INT", 1, gps_raw),
    _stream("SYSTEM_TIME", 1, system_time),
    _stream("SYS_STATUS", 1, status.system_status),
    _stream("EXTENDED_SYS_STATE", 1, status.extended_state),
    _stream("MISSION_CURRENT", 1, status.mission_current),
    _stream("CURRENT_MODE", 0.5, status.current_mode),
    _stream("BATTERY_STATUS", 0.5, status.battery),
    _stream("HOME_POSITION", 0.2, status.home_position),
    _stream("DEBUG_FLOAT_ARRAY", 0, loop_trace),
    _stream(
        "NAMED_VALUE_FLOAT",
        0,
        *(_named_value(name, Trace._fields.index(field)) for name, field in NAMED.items()),
    ),
)
BY_ID = {stream.message.message_id: stream for stream in STREAMS}


def position_dege7(state: AutopilotState) -> tuple[int, int]:
    """Latitude and longitude by dead reckoning; zero while home is not known."""
    if not state.home.known:
        return 0, 0
    at = state.estimate
    lat, lon = offset_to_geodetic(at.north_m, at.east_m, state.home.lat_deg, state.home.lon_deg)
    return int32(lat * 1e7), int32(lon * 1e7)
