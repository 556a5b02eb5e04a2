"""Checks of sensors with messages of their own: implausible, frozen and silent records. Pure."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.control.sensor_health.imu_checks import IMPLAUSIBLE
from autopilot.control.sensor_health.types import Device, Fault, Health
from autopilot.control.types import US_PER_S, Inputs
from mavlink_io.frames import geodetic_to_offset
from mavlink_io.jit import numeric
from mavlink_io.records import Altimeter, Battery, Dvl, GpsFix

GPS, ALTIMETER, DVL, BATTERY, LEAK, DUCT = "GPS", "Altimeter", "DVL", "Battery", "Leak", "Duct"

SILENT_US, BATTERY_SILENT_US, STUCK_US = 3 * US_PER_S, 10 * US_PER_S, 10 * US_PER_S
"""Minimum time without a record, or without a change, that is a fault.

A sensor with long intervals gets more: see SILENT_INTERVALS and STUCK_INTERVALS.
"""
DEFAULT_SILENT_US = 30 * US_PER_S
"""Time without a second record that is a fault, while the sensor's interval is unknown."""
SILENT_INTERVALS, STUCK_INTERVALS = 3, 5
"""Number of usual intervals without a record, or without a change, that is a fault."""
INTERVAL_CHANGE = 1.5
"""Maximum factor by which one record changes the usual interval: an outage or a burst is no new
interval."""
ACTIVE_US = US_PER_S // 2
"""Maximum age of the last record of a sensor that is stuck and not silent."""
FIX_JUMP_M, ECHO_JUMP_M, DVL_JUMP_MPS, DVL_MAX_MPS, CHARGE_JUMP = 50.0, 3.0, 1.0, 10.0, 0.2
"""Maximum plausible change between two records, and maximum velocity per axis of the Doppler
log (DVL). The charge is a fraction of full."""
FIX_MAX_MPS = 30.0
"""Maximum plausible speed of a fix: the vehicle may be on its ship."""
JUMP_WITHIN_US = 2 * US_PER_S
"""Maximum age of the last plausible record to which a change is compared."""
_NEITHER, _NONE_OF_FOUR = (None,) * 2, (None,) * 4
"""Inputs without GPS and altimeter, and without DVL, battery, leak and duct."""


def has_data(inputs: Inputs) -> bool:
    """Return whether any of the sensors has sent a record since the last tick."""
    return inputs[1:3] != _NEITHER or inputs[5:9] != _NONE_OF_FOUR


def update(
    health: Health, inputs: Inputs, excluded: frozenset[str]
) -> tuple[Health, Inputs, tuple[Fault, ...]]:
    """Check the records of a tick.

    Parameters
    ----------
    health : Health
        History of the sensors.
    inputs : Inputs
        Inputs of this tick.
    excluded : frozenset[str]
        Names of the sensors whose records must not be used.

    Returns
    -------
    tuple[Health, Inputs, tuple[Fault, ...]]
        The new history, the inputs without implausible and excluded records, and the faults.
    """
    now_us = inputs.sensors.time_us
    updated: dict[str, Any] = {}
    dropped: dict[str, Any] = {}
    faults = []
    for field, name, add in _DEVICES:
        record = getattr(inputs, field)
        if record is None:
            continue
        plausible, updated[field] = add(getattr(health.devices, field), record, now_us)
        if not plausible:
            faults.append(Fault(name, IMPLAUSIBLE))
        if not plausible or name in excluded:
            dropped[field] = None
    return (
        health._replace(devices=health.devices._replace(**updated)),
        inputs._replace(**dropped) if dropped else inputs,
        tuple(faults),
    )


@numeric
def add_fix(old: Device, fix: GpsFix, now_us: int) -> tuple[bool, Device]:
    """Add a satellite fix to the history; return whether it is plausible, and the new history.

    Plausible are a possible velocity, and a latitude and a longitude in range, near the last fix if
    that is recent.
    """
    if not math.hypot(fix.velocity_north_mps, fix.velocity_east_mps) < FIX_MAX_MPS:
        return False, _reject(old, now_us)
    plausible = abs(fix.lat_deg) <= 90.0 and abs(fix.lon_deg) <= 180.0
    if fix.fix_type >= 3 and _is_recent(old, now_us) and old.record.fix_type >= 3:
        before = old.record
        north_m, east_m = geodetic_to_offset(
            before.lat_deg, before.lon_deg, fix.lat_deg, fix.lon_deg
        )
        plausible = plausible and math.hypot(north_m, east_m) < FIX_JUMP_M
    if not plausible:
        return False, _reject(old, now_us)
    same = (
        has_record(old) and fix.lat_deg == old.record.lat_deg and fix.lon_deg == old.record.lon_deg
    )
    return True, _accept(old, fix, now_us, same)


@numeric
def add_range(old: Device, echo: Altimeter, now_us: int) -> tuple[bool, Device]:
    """Add a range to the history; it must be within the sensor's limits and not jump."""
    plausible = echo.min_range_m <= echo.range_m <= echo.max_range_m
    if plausible and _is_recent(old, now_us):
        plausible = abs(echo.range_m - old.record.range_m) < ECHO_JUMP_M
    if not plausible:
        return False, _reject(old, now_us)
    same = has_record(old) and echo.range_m == old.record.range_m
    return True, _accept(old, echo, now_us, same)


@numeric
def add_velocity(old: Device, ping: Dvl, now_us: int) -> tuple[bool, Device]:
    """Add a Doppler log velocity; each axis is limited, and must not jump in one tracking mode."""
    x, y, z = ping.velocity_x_mps, ping.velocity_y_mps, ping.velocity_z_mps
    plausible = abs(x) < DVL_MAX_MPS and abs(y) < DVL_MAX_MPS and abs(z) < DVL_MAX_MPS
    if plausible and _is_recent(old, now_us) and old.record.over_ground == ping.over_ground:
        before = old.record
        plausible = (
            abs(x - before.velocity_x_mps) < DVL_JUMP_MPS
            and abs(y - before.velocity_y_mps) < DVL_JUMP_MPS
            and abs(z - before.velocity_z_mps) < DVL_JUMP_MPS
        )
    if not plausible:
        return False, _reject(old, now_us)
    same = (
        has_record(old)
        and x == old.record.velocity_x_mps
        and y == old.record.velocity_y_mps
        and z == old.record.velocity_z_mps
    )
    return True, _accept(old, ping, now_us, same)


@numeric
def add_battery(old: Device, battery: Battery, now_us: int) -> tuple[bool, Device]:
    """Add a battery record: positive voltage, no jump of the charge (NaN: unknown, plausible)."""
    change = battery.remaining - old.record.remaining if _is_recent(old, now_us) else 0.0
    if not (battery.voltage_v > 0.0 and not abs(change) > CHARGE_JUMP):
        return False, _reject(old, now_us)
    return True, _accept(old, battery, now_us, False)


@numeric
def add_any(old: Device, record: Any, now_us: int) -> tuple[bool, Device]:
    """Add a record of a sensor without checks: leak detector and duct feedback."""
    return True, _accept(old, record, now_us, False)


@numeric
def has_record(device: Device) -> bool:
    """Return whether the sensor has sent a plausible record."""
    return device.accepted_us >= 0


@numeric
def _is_recent(device: Device, now_us: int) -> bool:
    """Return whether the last plausible record is recent enough to limit a change from it."""
    return has_record(device) and now_us - device.accepted_us < JUMP_WITHIN_US


@numeric
def _accept(old: Device, record: Any, now_us: int, same: bool) -> Device:
    """Return the history after a plausible record; ``same``: its reading equals the last one."""
    interval_us = _interval_us(old, now_us)
    usual_us = _update_interval_us(old.usual_interval_us, interval_us)
    changed_us = old.changed_us if same else now_us
    return Device(record, now_us, now_us, changed_us, interval_us, usual_us)


@numeric
def _reject(old: Device, now_us: int) -> Device:
    """Return the history after an implausible record."""
    interval_us = _interval_us(old, now_us)
    usual_us = _update_interval_us(old.usual_interval_us, interval_us)
    return Device(old.record, old.accepted_us, now_us, now_us, interval_us, usual_us)


@numeric
def _interval_us(old: Device, now_us: int) -> int:
    """Return the time since the last record; 0 for the first."""
    return now_us - old.received_us if old.received_us >= 0 else 0


@numeric
def _update_interval_us(usual_us: int, interval_us: int) -> int:
    """Return the usual interval (us): the newest one, at most a factor INTERVAL_CHANGE away."""
    if usual_us == 0:
        return interval_us
    return round(min(INTERVAL_CHANGE * usual_us, max(usual_us / INTERVAL_CHANGE, interval_us)))


@numeric
def is_silent(device: Device, now_us: int, min_silent_us: int = SILENT_US) -> bool:
    """Return whether a sensor that has sent records is silent, or was until its last record.

    The limit is SILENT_INTERVALS usual intervals, but at least ``min_silent_us``.
    """
    limit_us = (
        max(min_silent_us, SILENT_INTERVALS * device.usual_interval_us)
        if device.usual_interval_us > 0
        else DEFAULT_SILENT_US
    )
    return device.received_us >= 0 and limit_us < max(
        now_us - device.received_us, device.interval_us
    )


@numeric
def is_frozen(device: Device, now_us: int) -> bool:
    """Return whether a sensor still sends records, all with the same reading."""
    unchanged_us = device.received_us - device.changed_us
    return (
        unchanged_us > max(STUCK_US, STUCK_INTERVALS * device.usual_interval_us)
        and now_us - device.received_us < ACTIVE_US
    )


@numeric
def has_fix(fix: GpsFix) -> bool:
    """Return whether a record has a position fix (fix type 3D or better)."""
    return fix.fix_type >= 3


@numeric
def has_position(gps: Device) -> bool:
    """Return whether the last plausible record of the receiver has a position fix."""
    return has_record(gps) and has_fix(gps.record)


class _DeviceKind(NamedTuple):
    """Checks of the records of one kind of sensor."""

    field: str
    """Field of ``Inputs`` and of ``Devices``."""
    name: str
    add: Callable[[Device, Any, int], tuple[bool, Device]]
    """Check a record and add it to the history."""


_DEVICES = (
    _DeviceKind(field="gps", name=GPS, add=add_fix),
    _DeviceKind(field="altimeter", name=ALTIMETER, add=add_range),
    _DeviceKind(field="dvl", name=DVL, add=add_velocity),
    _DeviceKind(field="battery", name=BATTERY, add=add_battery),
    _DeviceKind(field="leak", name=LEAK, add=add_any),
    _DeviceKind(field="duct", name=DUCT, add=add_any),
)
