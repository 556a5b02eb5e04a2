"""Checks of sensors with messages of their own: implausible, frozen and silent records. Pure."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.control.sensor_health.imu_checks import IMPLAUSIBLE
from autopilot.control.sensor_health.types import Device, Fault, Health
from autopilot.control.types import US_PER_S, Inputs
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
JUMP_WITHIN_US = 2 * US_PER_S
"""Maximum age of the last plausible record to which a change is compared."""
_METRES_PER_DEG = 111_000.0
"""Metres per degree of latitude."""
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
    devices: dict[str, Any] = {}
    dropped: dict[str, Any] = {}
    faults = []
    for field, name, plausible, reading in _DEVICES:
        record = getattr(inputs, field)
        if record is None:
            continue
        old: Device = getattr(health, field)
        recent = old.record if now_us - old.accepted_us < JUMP_WITHIN_US else None
        interval_us = now_us - old.received_us if old.received_us >= 0 else 0
        usual_us = _update_interval_us(old.usual_interval_us, interval_us)
        if plausible(record, recent):
            same = old.record is not None and reading(record) == reading(old.record)
            devices[field] = Device(
                record=record,
                accepted_us=now_us,
                received_us=now_us,
                changed_us=old.changed_us if same else now_us,
                interval_us=interval_us,
                usual_interval_us=usual_us,
            )
            if name in excluded:
                dropped[field] = None
        else:
            faults.append(Fault(name, IMPLAUSIBLE))
            devices[field] = Device(
                record=old.record,
                accepted_us=old.accepted_us,
                received_us=now_us,
                changed_us=now_us,
                interval_us=interval_us,
                usual_interval_us=usual_us,
            )
            dropped[field] = None
    return (
        health._replace(**devices),
        inputs._replace(**dropped) if dropped else inputs,
        tuple(faults),
    )


def _update_interval_us(usual_us: int, interval_us: int) -> int:
    """Return the usual interval (us): the newest one, at most a factor INTERVAL_CHANGE away."""
    if not usual_us:
        return interval_us
    return round(min(INTERVAL_CHANGE * usual_us, max(usual_us / INTERVAL_CHANGE, interval_us)))


def is_silent(device: Device, now_us: int, min_silent_us: int = SILENT_US) -> bool:
    """Return whether a sensor that has sent records is silent, or was until its last record.

    The limit is SILENT_INTERVALS usual intervals, but at least ``min_silent_us``.
    """
    limit_us = (
        max(min_silent_us, SILENT_INTERVALS * device.usual_interval_us)
        if device.usual_interval_us
        else DEFAULT_SILENT_US
    )
    return device.received_us >= 0 and limit_us < max(
        now_us - device.received_us, device.interval_us
    )


def is_frozen(device: Device, now_us: int) -> bool:
    """Return whether a sensor still sends records, all with the same reading."""
    unchanged_us = device.received_us - device.changed_us
    return (
        unchanged_us > max(STUCK_US, STUCK_INTERVALS * device.usual_interval_us)
        and now_us - device.received_us < ACTIVE_US
    )


def has_fix(fix: GpsFix | None) -> bool:
    """Return whether a record has a position fix (fix type 3D or better)."""
    return fix is not None and fix.fix_type >= 3


def _plausible_fix(fix: GpsFix, before: GpsFix | None) -> bool:
    """Check latitude and longitude, and the distance from the last fix."""
    if fix.fix_type < 3 or before is None or before.fix_type < 3:
        return abs(fix.lat_deg) <= 90.0 and abs(fix.lon_deg) <= 180.0
    north_m = _METRES_PER_DEG * (fix.lat_deg - before.lat_deg)
    east_m = _METRES_PER_DEG * (fix.lon_deg - before.lon_deg) * math.cos(math.radians(fix.lat_deg))
    return math.hypot(north_m, east_m) < FIX_JUMP_M


def _plausible_range(echo: Altimeter, before: Altimeter | None) -> bool:
    """Check that the range is within the sensor's limits, and its change."""
    if not echo.min_range_m <= echo.range_m <= echo.max_range_m:
        return False
    return before is None or abs(echo.range_m - before.range_m) < ECHO_JUMP_M


def _plausible_velocity(ping: Dvl, before: Dvl | None) -> bool:
    """Check each axis, and its change if the tracking mode is the same."""
    x, y, z = _velocity(ping)
    if not (abs(x) < DVL_MAX_MPS and abs(y) < DVL_MAX_MPS and abs(z) < DVL_MAX_MPS):
        return False
    if before is None or before.over_ground != ping.over_ground:
        return True
    before_x, before_y, before_z = _velocity(before)
    return (
        abs(x - before_x) < DVL_JUMP_MPS
        and abs(y - before_y) < DVL_JUMP_MPS
        and abs(z - before_z) < DVL_JUMP_MPS
    )


def _plausible_battery(battery: Battery, before: Battery | None) -> bool:
    """Check voltage and change of charge; an unknown charge is NaN and plausible."""
    change = battery.remaining - before.remaining if before else 0.0
    return battery.voltage_v > 0.0 and not abs(change) > CHARGE_JUMP


def _always_plausible(record: object, before: object) -> bool:
    """Accept any record."""
    return True


def _position(fix: GpsFix) -> tuple[float, float]:
    """Return latitude and longitude (deg)."""
    return fix.lat_deg, fix.lon_deg


def _range(echo: Altimeter) -> float:
    """Return the range (m)."""
    return echo.range_m


def _velocity(ping: Dvl) -> tuple[float, float, float]:
    """Return the velocity in body axes (m/s)."""
    return ping.velocity_x_mps, ping.velocity_y_mps, ping.velocity_z_mps


def _whole_record(record: object) -> object:
    """Return the record: all its fields are compared."""
    return record


class _DeviceKind(NamedTuple):
    """Checks of the records of one kind of sensor."""

    field: str
    """Field of ``Inputs`` and of ``Health``."""
    name: str
    plausible: Callable[[Any, Any], bool]
    """Check of a record; the second argument is the last plausible record, None if too old."""
    reading: Callable[[Any], object]
    """Part of a record that stays the same when the sensor is stuck."""


_DEVICES = (
    _DeviceKind(field="gps", name=GPS, plausible=_plausible_fix, reading=_position),
    _DeviceKind(field="altimeter", name=ALTIMETER, plausible=_plausible_range, reading=_range),
    _DeviceKind(field="dvl", name=DVL, plausible=_plausible_velocity, reading=_velocity),
    _DeviceKind(field="battery", name=BATTERY, plausible=_plausible_battery, reading=_whole_record),
    _DeviceKind(field="leak", name=LEAK, plausible=_always_plausible, reading=_whole_record),
    _DeviceKind(field="duct", name=DUCT, plausible=_always_plausible, reading=_whole_record),
)
