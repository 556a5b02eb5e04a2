"""Telemetry for tools that know only ArduPilot: further messages, and groups of streams.

Sources: ArduPilot, libraries/GCS_MAVLink/GCS_Common.cpp and ArduSub/GCS_Mavlink.cpp (groups of
streams); Cockpit, src/libs/vehicle/mavlink/defaults.ts (messages that it requests). Messages
without a measurement on this vehicle, such as POWER_STATUS, are not sent.
"""

import math

from autopilot.control.manual_control import channels_of
from autopilot.reports import Snapshot
from autopilot.telemetry import identity, navigation
from autopilot.telemetry.encoding import boot_ms, int16, time_us
from autopilot.telemetry.streams import STREAMS, TelemetryStream, stream
from autopilot.telemetry.tick_messages import position_dege7
from mavlink_io.dialect import Values, constant
from mavlink_io.frames import STANDARD_GRAVITY_MPS2, euler_from_quaternion

_CHANNELS = 18
"""Number of channels of RC_CHANNELS."""
_NO_CHANNEL = 65_535
"""Value of a channel that does not exist."""
_UNKNOWN_RSSI = 255
_EKF_FLAGS = 0x3FF
"""Flags that ESTIMATOR_STATUS and EKF_STATUS_REPORT share."""
_GLITCH, _EKF_GLITCH = constant("ESTIMATOR_GPS_GLITCH"), constant("EKF_GPS_GLITCHING")
_UNINITIALIZED = constant("EKF_UNINITIALIZED")


def current_mode(s: Snapshot) -> Values:
    """Return CURRENT_MODE with ArduSub's numbers."""
    return identity.current_mode(s.state, s.intended_mode, identity.ARDUSUB_MODES)


def attitude_and_position(s: Snapshot) -> Values:
    """Return AHRS2: attitude (rad), altitude (m) and position (degE7)."""
    estimate = s.state.estimate
    attitude = euler_from_quaternion(*estimate.attitude)
    return *attitude, -estimate.depth_m, *position_dege7(estimate, s.home)


def ekf_status(s: Snapshot) -> Values:
    """Return EKF_STATUS_REPORT: the flags of ESTIMATOR_STATUS; variances are not available."""
    estimated = navigation.estimator_status(s)[-1]
    flags = estimated & _EKF_FLAGS
    flags |= _EKF_GLITCH if estimated & _GLITCH else 0
    flags |= 0 if s.state.estimate.initialised else _UNINITIALIZED
    return *(0.0,) * 5, flags, 0.0


def rc_channels(s: Snapshot) -> Values:
    """Return RC_CHANNELS: the manual control as pulse widths (us)."""
    channels_us = channels_of(s.stick) if s.stick is not None else ()
    absent = (_NO_CHANNEL,) * (_CHANNELS - len(channels_us))
    return boot_ms(s), *channels_us, *absent, len(channels_us), _UNKNOWN_RSSI


def rangefinder(s: Snapshot) -> Values:
    """Return RANGEFINDER: altitude above the sea floor (m); 0 without an echo."""
    altitude_m = s.state.estimate.altitude_m
    return 0.0 if math.isnan(altitude_m) else altitude_m, 0.0


def _inertial(s: Snapshot) -> tuple[int, ...]:
    """Return acceleration (mG), body rates (mrad/s) and magnetic field (mgauss)."""
    if s.sensors is None:
        return (0,) * 9
    acceleration, rates, field = s.sensors[1:4], s.sensors[4:7], s.sensors[7:10]
    return (
        *(int16(a / STANDARD_GRAVITY_MPS2 * 1e3) for a in acceleration),
        *(int16(value * 1e3) for value in (*rates, *field)),
    )


def _temperature_cdegc(s: Snapshot) -> int:
    """Return the temperature of the sensors."""
    return 0 if s.sensors is None else int16(s.sensors.temperature_degc * 100.0)


def raw_imu(s: Snapshot) -> Values:
    """Return RAW_IMU, in the units of SCALED_IMU as ArduPilot sends it."""
    return time_us(s), *_inertial(s), 0, _temperature_cdegc(s)


def scaled_imu(s: Snapshot) -> Values:
    """Return SCALED_IMU2."""
    return boot_ms(s), *_inertial(s), _temperature_cdegc(s)


def wind(s: Snapshot) -> Values:
    """Return WIND with the water current: direction that it comes from (deg), speed (m/s)."""
    current_mps = s.state.estimate.navigation.current_mps
    from_deg = math.degrees(math.atan2(-current_mps.imag, -current_mps.real))
    return from_deg, abs(current_mps), 0.0


ARDUPILOT_STREAMS: tuple[TelemetryStream, ...] = (
    *(
        row._replace(build=current_mode) if row.message.name == "CURRENT_MODE" else row
        for row in STREAMS
    ),
    stream("AHRS2", 4, attitude_and_position),
    stream("EKF_STATUS_REPORT", 1, ekf_status),
    stream("RC_CHANNELS", 2, rc_channels),
    stream("RANGEFINDER", 2, rangefinder),
    stream("RAW_IMU", 2, raw_imu),
    stream("SCALED_IMU2", 2, scaled_imu),
    stream("WIND", 1, wind),
)
"""Telemetry table with ArduPilot's messages."""

_GROUPS = {
    "RAW_SENSORS": ("RAW_IMU", "SCALED_IMU2", "SCALED_PRESSURE2"),
    "EXTENDED_STATUS": (
        "SYS_STATUS",
        "MISSION_CURRENT",
        "GPS_RAW_INT",
        "NAV_CONTROLLER_OUTPUT",
    ),
    "RC_CHANNELS": ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    "POSITION": ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    "EXTRA1": ("ATTITUDE", "AHRS2"),
    "EXTRA2": ("VFR_HUD",),
    "EXTRA3": (
        "SYSTEM_TIME",
        "RANGEFINDER",
        "DISTANCE_SENSOR",
        "BATTERY_STATUS",
        "EKF_STATUS_REPORT",
        "WIND",
    ),
}
_IDS = {row.message.name: row.message.message_id for row in ARDUPILOT_STREAMS}
_MESSAGES_BY_GROUP = {
    constant(f"MAV_DATA_STREAM_{group}"): tuple(_IDS[name] for name in names)
    for group, names in _GROUPS.items()
}
STREAM_GROUPS = _MESSAGES_BY_GROUP | {
    constant("MAV_DATA_STREAM_ALL"): tuple(
        number for ids in _MESSAGES_BY_GROUP.values() for number in ids
    )
}
"""Message ids of each MAV_DATA_STREAM."""
