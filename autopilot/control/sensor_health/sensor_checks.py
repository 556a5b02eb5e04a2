"""What is wrong with a device that speaks for itself: words that cannot be, the same words for
ever, none at all."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.control.sensor_health.imu_checks import IMPLAUSIBLE
from autopilot.control.sensor_health.types import Device, Fault, Health
from autopilot.control.types import US_PER_S, Inputs
from mavlink_io.records import Altimeter, Battery, Dvl, GpsFix

GPS, ALTIMETER, DVL, BATTERY, LEAK, DUCT = "GPS", "Altimeter", "DVL", "Battery", "Leak", "Duct"

SILENT_US, BATTERY_SILENT_US, STUCK_US = 3 * US_PER_S, 10 * US_PER_S, 10 * US_PER_S
"""The least that is called silence or standing still; a device that speaks seldom is given more."""
DEFAULT_SILENT_US = 30 * US_PER_S
"""Silence after a first word, while nobody knows when the second is due."""
SILENT_INTERVALS, STUCK_INTERVALS = 3, 5
INTERVAL_CHANGE = 1.5
"""From word to word the usual interval follows by no more than this factor: an outage or a burst is
not a pace."""
ACTIVE_US = US_PER_S // 2
FIX_JUMP_M, ECHO_JUMP_M, DVL_JUMP_MPS, DVL_MAX_MPS, CHARGE_JUMP = 50.0, 3.0, 1.0, 10.0, 0.2
JUMP_WITHIN_US = 2 * US_PER_S
"""Words further apart may differ by anything."""
_METRES_PER_DEG = 111_000.0
_NEITHER, _NONE_OF_FOUR = (None,) * 2, (None,) * 4
"""GPS and altimeter; DVL, battery, leak and duct: as ``Inputs`` has them."""


def has_data(inputs: Inputs) -> bool:
    """Whether any device did since the last tick."""
    return inputs[1:3] != _NEITHER or inputs[5:9] != _NONE_OF_FOUR


def update(
    health: Health, inputs: Inputs, excluded: frozenset[str]
) -> tuple[Health, Inputs, tuple[Fault, ...]]:
    """Take in what devices say; a record that cannot be, or that is of one ``excluded``, goes no
    further."""
    now_us = inputs.sensors.time_us
    heard: dict[str, Any] = {}
    dropped: dict[str, Any] = {}
    complaints = []
    for field, name, possible, reading in _DEVICES:
        record = getattr(inputs, field)
        if record is None:
            continue
        old: Device = getattr(health, field)
        lately = old.record if now_us - old.sound_us < JUMP_WITHIN_US else None
        interval_us = now_us - old.heard_us if old.heard_us >= 0 else 0
        pace_us = _update_interval_us(old.pace_us, interval_us)
        if possible(record, lately):
            same = old.record is not None and reading(record) == reading(old.record)
            heard[field] = Device(
                record, now_us, now_us, old.changed_us if same else now_us, interval_us, pace_us
            )
            if name in excluded:
                dropped[field] = None
        else:
            complaints.append(Fault(name, IMPLAUSIBLE))
            heard[field] = Device(old.record, old.sound_us, now_us, now_us, interval_us, pace_us)
            dropped[field] = None
    return (
        health._replace(**heard),
        inputs._replace(**dropped) if dropped else inputs,
        tuple(complaints),
    )


def _update_interval_us(usual_us: int, interval_us: int) -> int:
    """The usual interval, with the one that has just passed."""
    if not usual_us:
        return interval_us
    return round(min(INTERVAL_CHANGE * usual_us, max(usual_us / INTERVAL_CHANGE, interval_us)))


def is_silent(device: Device, now_us: int, at_least_us: int = SILENT_US) -> bool:
    """Whether a device that has spoken does so no more, or only after far longer than is its own
    pace."""
    limit_us = (
        max(at_least_us, SILENT_INTERVALS * device.pace_us) if device.pace_us else DEFAULT_SILENT_US
    )
    return device.heard_us >= 0 and limit_us < max(now_us - device.heard_us, device.interval_us)


def is_frozen(device: Device, now_us: int) -> bool:
    """Whether it still speaks, and says the same."""
    same_us = device.heard_us - device.changed_us
    return (
        same_us > max(STUCK_US, STUCK_INTERVALS * device.pace_us)
        and now_us - device.heard_us < ACTIVE_US
    )


def has_fix(fix: GpsFix | None) -> bool:
    """Whether the receiver knows where it is."""
    return fix is not None and fix.fix_type >= 3


def _plausible_fix(fix: GpsFix, before: GpsFix | None) -> bool:
    if fix.fix_type < 3 or before is None or before.fix_type < 3:
        return abs(fix.lat_deg) <= 90.0 and abs(fix.lon_deg) <= 180.0
    north_m = _METRES_PER_DEG * (fix.lat_deg - before.lat_deg)
    east_m = _METRES_PER_DEG * (fix.lon_deg - before.lon_deg) * math.cos(math.radians(fix.lat_deg))
    return math.hypot(north_m, east_m) < FIX_JUMP_M


def _plausible_range(echo: Altimeter, before: Altimeter | None) -> bool:
    if not echo.min_range_m <= echo.range_m <= echo.max_range_m:
        return False
    return before is None or abs(echo.range_m - before.range_m) < ECHO_JUMP_M


def _plausible_velocity(seen: Dvl, before: Dvl | None) -> bool:
    x, y, z = _velocity(seen)
    if not (abs(x) < DVL_MAX_MPS and abs(y) < DVL_MAX_MPS and abs(z) < DVL_MAX_MPS):
        return False
    if before is None or before.over_ground != seen.over_ground:
        return True
    was_x, was_y, was_z = _velocity(before)
    return (
        abs(x - was_x) < DVL_JUMP_MPS
        and abs(y - was_y) < DVL_JUMP_MPS
        and abs(z - was_z) < DVL_JUMP_MPS
    )


def _plausible_battery(seen: Battery, before: Battery | None) -> bool:
    """A gauge that does not know what remains says NaN, and may."""
    change = seen.remaining - before.remaining if before else 0.0
    return seen.voltage_v > 0.0 and not abs(change) > CHARGE_JUMP


def _always_plausible(record: object, before: object) -> bool:
    return True


def _place(fix: GpsFix) -> tuple[float, float]:
    return fix.lat_deg, fix.lon_deg


def _range(echo: Altimeter) -> float:
    return echo.range_m


def _velocity(seen: Dvl) -> tuple[float, float, float]:
    return seen.velocity_x_mps, seen.velocity_y_mps, seen.velocity_z_mps


def _all_finite(record: object) -> object:
    return record


class _DeviceKind(NamedTuple):
    field: str
    """Of ``Inputs`` and of ``Health``."""
    name: str
    possible: Callable[[Any, Any], bool]
    """Whether a record can be, after another one."""
    reading: Callable[[Any], object]
    """What stands still in a record when the device is stuck."""


_DEVICES = (
    _DeviceKind("gps", GPS, _plausible_fix, _place),
    _DeviceKind("altimeter", ALTIMETER, _plausible_range, _range),
    _DeviceKind("dvl", DVL, _plausible_velocity, _velocity),
    _DeviceKind("battery", BATTERY, _plausible_battery, _all_finite),
    _DeviceKind("leak", LEAK, _always_plausible, _all_finite),
    _DeviceKind("duct", DUCT, _always_plausible, _all_finite),
)
