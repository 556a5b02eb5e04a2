"""Vehicle status as messages: health, battery, mode, mission and home."""

import math

from autopilot.control import failsafe, modes
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import (
    ALTIMETER,
    BATTERY,
    DUCT,
    DVL,
    GPS,
)
from autopilot.control.types import AscentStage, AutopilotState
from autopilot.reports import Snapshot
from autopilot.telemetry import identity
from autopilot.telemetry.encoding import clamp, int32, time_us, uint16
from autopilot.vehicle import mission_progress
from mavlink_io import device_messages
from mavlink_io.dialect import Values, constant
from mavlink_io.records import Battery

_ON_SURFACE, _SUBMERGED = (
    constant("MAV_LANDED_STATE_ON_GROUND"),
    constant("MAV_LANDED_STATE_IN_AIR"),
)
_CHARGE_OK, _CHARGE_LOW = (
    constant("MAV_BATTERY_CHARGE_STATE_OK"),
    constant("MAV_BATTERY_CHARGE_STATE_LOW"),
)

_SENSORS = sum(
    constant(f"MAV_SYS_STATUS_SENSOR_{name}")
    for name in ("3D_GYRO", "3D_ACCEL", "3D_MAG", "ABSOLUTE_PRESSURE", "GPS", "MOTOR_OUTPUTS")
)
_CONTROLS = sum(
    constant(f"MAV_SYS_STATUS_SENSOR_{name}")
    for name in (
        "ANGULAR_RATE_CONTROL",
        "ATTITUDE_STABILIZATION",
        "YAW_POSITION",
        "Z_ALTITUDE_CONTROL",
    )
)
_PREARM = constant("MAV_SYS_STATUS_PREARM_CHECK")
_BITS = {
    name: constant(f"MAV_SYS_STATUS_{bit}")
    for name, bit in {
        monitor.ACCELEROMETER: "SENSOR_3D_ACCEL",
        monitor.GYRO: "SENSOR_3D_GYRO",
        monitor.MAGNETOMETER: "SENSOR_3D_MAG",
        monitor.PRESSURE: "SENSOR_ABSOLUTE_PRESSURE",
        GPS: "SENSOR_GPS",
        ALTIMETER: "SENSOR_LASER_POSITION",
        DVL: "SENSOR_VISION_POSITION",
        BATTERY: "SENSOR_BATTERY",
        DUCT: "SENSOR_MOTOR_OUTPUTS",
        monitor.DEPTH: "SENSOR_Z_ALTITUDE_CONTROL",
        monitor.ELEVATOR: "SENSOR_ATTITUDE_STABILIZATION",
        monitor.PITCH: "SENSOR_ATTITUDE_STABILIZATION",
        monitor.RUDDER: "SENSOR_YAW_POSITION",
    }.items()
}
"""Bit of SYS_STATUS by sensor. Altimeter and Doppler log use the bits of similar sensors."""
_BOUNDARY = constant("FENCE_BREACH_BOUNDARY")
"""FENCE_BREACH: the horizontal fence; the depth band is a failsafe of its own."""
_GEOFENCE = constant("MAV_SYS_STATUS_GEOFENCE")
"""Healthy without a fence: otherwise MAVProxy reports a breach of a fence that does not exist."""


def system_status(s: Snapshot) -> Values:
    """Return SYS_STATUS.

    The GPS bit is healthy under water too: clients refuse to arm without it. It means that the
    position is known. After the first stage of SURFACE the depth is not controlled;
    ``errors_count1`` is the stage.
    """
    sensors = _SENSORS if s.state.estimate.initialised else 0
    health = s.state.health
    extra = _device_bits(s) | (device_messages.EXTENSION_USED if s.leak else 0)
    inside = 0 if s.state.failsafe == failsafe.FENCE else _GEOFENCE
    extra |= _GEOFENCE if s.state.fence.zones else 0
    present = _SENSORS | _CONTROLS | _PREARM | extra
    ready = _PREARM if s.state.estimate.initialised and not monitor.prearm_failure(health) else 0
    enabled = _SENSORS | _PREARM | (_CONTROLS if s.state.armed else 0) | extra
    faulty = sum(_BITS.get(name, 0) for name in monitor.active_faults(health))
    stage = ascent_stage(s.state)
    faulty |= _BITS[monitor.DEPTH] if stage != AscentStage.POWERED else 0
    healthy = (sensors | _CONTROLS | ready | extra & ~_GEOFENCE | inside) & ~faulty
    leak_sensor = device_messages.LEAK_BIT if s.leak else 0
    dry = leak_sensor if s.leak and not s.leak.wet else 0
    return (
        present,
        enabled,
        healthy,
        0,
        *_power(s.battery),
        0,
        0,
        int(stage),
        *(0,) * 3,
        _percent(s.battery),
        leak_sensor,
        leak_sensor,
        dry,
    )


def ascent_stage(state: AutopilotState) -> AscentStage:
    """Return the stage of mode SURFACE; POWERED in another mode."""
    if state.ascent is None or not state.armed or state.mode != modes.SURFACE.number:
        return AscentStage.POWERED
    return state.ascent.stage


def fence_status(s: Snapshot) -> Values:
    """Return FENCE_STATUS: whether the position is forbidden now, and the breaches so far."""
    state = s.state
    outside = bool(failsafe.fence_breach(state, s.config, ahead=False))
    return (
        state.fence_breach_us // 1000,
        min(state.fence_breaches, device_messages.UNKNOWN_U16),
        outside,
        _BOUNDARY if state.fence_breaches else 0,
        0,
    )


def _device_bits(s: Snapshot) -> int:
    """Return the bits of optional devices that have sent data."""
    log = s.state.health.devices.dvl.record
    devices = (BATTERY, s.battery), (ALTIMETER, s.altimeter), (DVL, log)
    return sum(_BITS[name] for name, record in devices if record is not None)


def battery(s: Snapshot) -> Values:
    """Return BATTERY_STATUS; every field is unknown without a battery gauge."""
    if s.battery is None:
        unknown = (device_messages.UNKNOWN_U16,) * 10
        return (
            -1,
            -1,
            device_messages.UNKNOWN_TEMPERATURE,
            unknown,
            -1,
            0,
            1,
            0,
            -1,
            0,
            0,
            (0,) * 4,
            0,
            0,
        )
    return device_messages.battery_values(s.battery, _charge_state(s, s.battery))


def _charge_state(s: Snapshot, gauge: Battery) -> int:
    """Return the charge state.

    LOW comes from the battery fault; CRITICAL is half, EMERGENCY a quarter of its threshold.
    """
    if monitor.active_faults(s.state.health).get(BATTERY) != monitor.LOW:
        return _CHARGE_OK
    threshold_ratio = (
        100.0 * gauge.remaining / s.config.fs_battery_pct if s.config.fs_battery_pct else 1.0
    )
    return _CHARGE_LOW + (threshold_ratio <= 0.5) + (threshold_ratio <= 0.25)


def extended_state(s: Snapshot) -> Values:
    """Return EXTENDED_SYS_STATE: on the surface or submerged."""
    at_surface = not s.state.armed and s.state.estimate.depth_m < s.config.surfaced_depth_m
    return 0, _ON_SURFACE if at_surface else _SUBMERGED


def mission_current(s: Snapshot) -> Values:
    """Return MISSION_CURRENT."""
    return mission_progress(s.state, s.config)


def current_mode(s: Snapshot) -> Values:
    """Return CURRENT_MODE."""
    return identity.current_mode(s.state, s.intended_mode)


def home_position(s: Snapshot) -> Values:
    """Return HOME_POSITION; home is at the surface, so its altitude is zero."""
    home = s.state.home
    level, origin, approach = (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3
    return (
        int32(home.lat_deg * 1e7),
        int32(home.lon_deg * 1e7),
        0,
        *origin,
        level,
        *approach,
        time_us(s),
    )


def _power(battery: Battery | None) -> tuple[int, int]:
    """Return voltage (mV) and current (cA) for SYS_STATUS."""
    if battery is None:
        return device_messages.UNKNOWN_U16, -1
    return uint16(battery.voltage_v * 1000.0), device_messages.centiamperes(battery.current_a)


def _percent(battery: Battery | None) -> int:
    """Return the remaining charge in percent; -1 when it is unknown."""
    return (
        -1
        if battery is None or math.isnan(battery.remaining)
        else clamp(battery.remaining * 100.0, 0, 100)
    )
