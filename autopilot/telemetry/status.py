"""How the vehicle is, as messages: health, battery, mode, mission, home."""

import math

from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import (
    ALTIMETER,
    BATTERY,
    DUCT,
    DVL,
    GPS,
)
from autopilot.telemetry import identity
from autopilot.telemetry.encoding import clamp, int32, time_us, uint16
from autopilot.vehicle import Snapshot, mission_progress
from mavlink_io import device_messages
from mavlink_io.dialect import Values, constant
from mavlink_io.records import Battery

_SURFACED, _UNDER_WAY = constant("MAV_LANDED_STATE_ON_GROUND"), constant("MAV_LANDED_STATE_IN_AIR")
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
    }.items()
}
"""Where SYS_STATUS shows what: the altimeter as rangefinders are, the Doppler log as what else
tells velocity."""
_GEOFENCE = constant("MAV_SYS_STATUS_GEOFENCE")
"""Healthy always, or MAVProxy announces a breach of a fence that does not exist."""


def system_status(s: Snapshot) -> Values:
    """GPS counts as healthy under water too: it means that the position is known, or no client ever
    arms."""
    sensors = _SENSORS if s.state.estimate.initialised else 0
    seen = s.state.health
    extra = _device_bits(s) | (device_messages.EXTENSION_USED if s.leak else 0)
    present = _SENSORS | _CONTROLS | _PREARM | extra
    ready = _PREARM if s.state.estimate.initialised and not monitor.prearm_failure(seen) else 0
    enabled = _SENSORS | _PREARM | (_CONTROLS if s.state.armed else 0) | extra
    wrong = sum(_BITS.get(name, 0) for name in monitor.active_faults(seen))
    sound = (sensors | _CONTROLS | _GEOFENCE | ready | extra) & ~wrong
    fitted = device_messages.LEAK_BIT if s.leak else 0
    dry = fitted if s.leak and not s.leak.wet else 0
    return (
        present,
        enabled,
        sound,
        0,
        *_power(s.battery),
        *(0,) * 6,
        _percent(s.battery),
        fitted,
        fitted,
        dry,
    )


def _device_bits(s: Snapshot) -> int:
    """The bits of devices that a vehicle may or may not carry."""
    further = (BATTERY, s.battery), (ALTIMETER, s.altimeter), (DVL, s.state.health.dvl.record)
    return sum(_BITS[name] for name, heard in further if heard is not None)


def battery(s: Snapshot) -> Values:
    """What the gauge says; without one every field says unknown."""
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
    """Low where the vehicle calls it so; critical at half of that charge, an emergency at a
    quarter."""
    if monitor.active_faults(s.state.health).get(BATTERY) != monitor.LOW:
        return _CHARGE_OK
    share = 100.0 * gauge.remaining / s.config.fs_battery_pct if s.config.fs_battery_pct else 1.0
    return _CHARGE_LOW + (share <= 0.5) + (share <= 0.25)


def extended_state(s: Snapshot) -> Values:
    afloat = not s.state.armed and s.state.estimate.depth_m < s.config.surfaced_depth_m
    return 0, _SURFACED if afloat else _UNDER_WAY


def mission_current(s: Snapshot) -> Values:
    return mission_progress(s.state, s.config)


def current_mode(s: Snapshot) -> Values:
    return identity.current_mode(s.state, s.intended_mode)


def home_position(s: Snapshot) -> Values:
    """Home lies at the surface: altitude zero, whatever the satellite says."""
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
    """Voltage in mV and current in cA, as SYS_STATUS has them."""
    if battery is None:
        return device_messages.UNKNOWN_U16, -1
    return uint16(battery.voltage_v * 1000.0), device_messages.centiamperes(battery.current_a)


def _percent(battery: Battery | None) -> int:
    return (
        -1
        if battery is None or math.isnan(battery.remaining)
        else clamp(battery.remaining * 100.0, 0, 100)
    )
