"""HIGH_LATENCY2: the whole state of the vehicle in 42 bytes, for satellite and acoustic modems.

Source: https://mavlink.io/en/messages/common.html#HIGH_LATENCY2. Values that the vehicle does not
know are 0, as the message has no value for "unknown".
"""

import math

from autopilot.control import failsafe, guidance
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import ALTIMETER, BATTERY, DUCT, GPS
from autopilot.reports import Snapshot
from autopilot.telemetry.encoding import boot_ms, clamp, int16
from autopilot.telemetry.identity import ModeTable, heartbeat
from autopilot.telemetry.tick_messages import position_dege7
from autopilot.vehicle import mission_progress
from mavlink_io.dialect import Values, constant

_FLAGS = {
    name: constant(f"HL_FAILURE_FLAG_{flag}")
    for name, flag in {
        GPS: "GPS",
        monitor.PRESSURE: "ABSOLUTE_PRESSURE",
        monitor.ACCELEROMETER: "3D_ACCEL",
        monitor.GYRO: "3D_GYRO",
        monitor.MAGNETOMETER: "3D_MAG",
        ALTIMETER: "TERRAIN",
        BATTERY: "BATTERY",
        DUCT: "ENGINE",
    }.items()
}
_GEOFENCE, _ESTIMATOR = (constant(f"HL_FAILURE_FLAG_{flag}") for flag in ("GEOFENCE", "ESTIMATOR"))
_SPEED_UNIT_MPS, _ANGLE_UNIT_DEG, _DISTANCE_UNIT_M, _ERROR_UNIT_M = 0.2, 2.0, 10.0, 0.1


def high_latency(s: Snapshot, autopilot: int, table: ModeTable) -> Values:
    """Return the fields of HIGH_LATENCY2 in wire order.

    custom0 is HEARTBEAT.base_mode, as ArduPilot sends it, and custom1 its system_status.
    """
    estimate, state, trace = s.state.estimate, s.state, s.trace
    custom_mode, kind, _, base_mode, system_status, _ = heartbeat(state, autopilot, table)
    distance_m = guidance.progress(state.path, estimate)[0] if state.path is not None else 0.0
    current_mps = estimate.navigation.current_mps
    current_from_rad = math.atan2(-current_mps.imag, -current_mps.real)
    ground_speed_mps = math.hypot(estimate.north_rate_mps, estimate.east_rate_mps)
    remaining = math.nan if s.battery is None else 100.0 * s.battery.remaining
    temperature_degc = 0.0 if s.sensors is None else s.sensors.temperature_degc
    return (
        boot_ms(s),
        *position_dege7(estimate, state.home),
        custom_mode >> table.high_latency_shift & 0xFFFF,
        int16(-estimate.depth_m),
        int16(-state.setpoint.depth_m),
        clamp(distance_m / _DISTANCE_UNIT_M, 0, 65_535),
        mission_progress(state, s.config).sequence,
        _failures(s),
        kind,
        autopilot,
        _half_degrees(estimate.heading_rad),
        _half_degrees(state.setpoint.heading_rad),
        clamp(abs(trace.thrust) * 100.0, 0, 100),
        _speed(estimate.speed_mps),
        0,
        _speed(ground_speed_mps),
        _speed(abs(current_mps)),
        _half_degrees(current_from_rad),
        clamp(estimate.position_sd_m / _ERROR_UNIT_M, 0, 255),
        0,
        clamp(temperature_degc, -128, 127),
        clamp(-estimate.depth_rate_mps / _ERROR_UNIT_M, -128, 127),
        -1 if math.isnan(remaining) else clamp(remaining, 0, 100),
        base_mode - 256 if base_mode > 127 else base_mode,
        system_status,
        0,
    )


def _failures(s: Snapshot) -> int:
    """Return the HL_FAILURE_FLAG bits."""
    active = monitor.active_faults(s.state.health)
    flags = sum(_FLAGS.get(name, 0) for name in active)
    flags |= _GEOFENCE if s.state.failsafe == failsafe.FENCE else 0
    return flags | (0 if s.state.estimate.initialised else _ESTIMATOR)


def _half_degrees(angle_rad: float) -> int:
    """Return an angle in units of 2 degrees, 0 to 179."""
    return clamp(math.degrees(angle_rad) % 360.0 / _ANGLE_UNIT_DEG, 0, 180) % 180


def _speed(speed_mps: float) -> int:
    """Return a speed in units of 0.2 m/s."""
    return clamp(speed_mps / _SPEED_UNIT_MPS, 0, 255)
