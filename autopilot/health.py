"""What is wrong on board, by what the vehicle herself can see: pure, part of the tick.

A complaint that lasts is believed: it is told once, clears a health bit, refuses arming, and its instrument is no
longer listened to until it has been sound for a while.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot import ahrs, modes
from autopilot.ahrs import IMPLAUSIBLE, SILENT, STUCK
from autopilot.params import Config
from autopilot.types import US_PER_S, Complaint, Device, Doubt, Event, Health, Inputs, Severity, State
from link.records import Altimeter, Battery, DuctFeedback, Dvl, GpsFix, Leak

ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE = (group.name for group in ahrs.GROUPS)
GPS, ALTIMETER, DVL, BATTERY, LEAK, DUCT, DEPTH = "GPS", "Altimeter", "DVL", "Battery", "Leak", "Duct", "Depth"
VITAL = frozenset((ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE, BATTERY, LEAK, DUCT))
"""Nobody should go to sea without."""
DETECTED, LOW, ASTRAY, UNANSWERED = "detected", "low", "does not follow", "does not answer"

RECOVERY_US = 5 * US_PER_S
"""Soundness that lasts for so long is believed: longer than a device may be silent."""
GRACE_US, IMPLAUSIBLE_GRACE_US = US_PER_S // 2, 3 * US_PER_S // 2
"""A doubt that nothing has nourished for so long is dropped; implausible readings may come a second apart."""
CHECK_US = US_PER_S // 5
DEVICE_SILENT_US, BATTERY_SILENT_US = 3 * US_PER_S, 10 * US_PER_S
DEVICE_STUCK_US = 10 * US_PER_S
DUCT_LAG_S = 0.7
"""Transport delay and lag of the tailcone together."""
MOVING_MPS = 0.02
ASKED_THRUST, ASKED_DEPTH_M = 0.2, 1.0
"""From here on a depth that stays away is expected to come."""
FIX_JUMP_M, ECHO_JUMP_M, DVL_JUMP_MPS = 50.0, 3.0, 1.0
JUMP_WITHIN_US = 2 * US_PER_S
_METRES_PER_DEG = 111_000.0


class Patience(NamedTuple):
    """How often and how long a complaint must be heard before it is believed."""

    times: int
    lasting_us: int


_AT_ONCE = Patience(1, 0)
_PATIENCE = {IMPLAUSIBLE: Patience(5, 0), LOW: Patience(5, US_PER_S), ASTRAY: Patience(5, 2 * US_PER_S)}

Screened = tuple[Health, Inputs, tuple[Event, ...]]


def screen(state: State, inputs: Inputs, config: Config) -> Screened:
    """Take in what the instruments say: the memory, what may be believed of it, and what to tell.

    ``fields_updated`` of the sample that is given back names the groups that may be used.
    """
    health, now_us = state.health, inputs.sensors.time_us
    excluded = _excluded(health) if health.doubts else _NOBODY
    heard, sample, complaints = ahrs.hear(health.ahrs, inputs.sensors, excluded, config)
    health = health._replace(ahrs=heard)
    if sample is not inputs.sensors:
        inputs = inputs._replace(sensors=sample)
    if inputs.gps or inputs.altimeter or inputs.dvl or inputs.battery or inputs.leak or inputs.duct:
        health, inputs, wrong = _hear_devices(health, inputs, state, excluded)
        complaints += wrong
    if now_us >= health.check_us:
        complaints += _slow_complaints(health, state, now_us, config)
        health = health._replace(check_us=now_us + CHECK_US)
    if not complaints and not health.doubts:
        return health, inputs, ()
    doubts, events = _weigh(health.doubts, complaints, now_us, config)
    return health._replace(doubts=doubts), inputs, events


def expect_duct(health: Health, rudder: float, elevator: float, dt_s: float) -> Health:
    """Follow where the duct should be by the controls of this tick."""
    way = min(1.0, dt_s / DUCT_LAG_S)
    at_rudder, at_elevator = health.duct_expected
    follows = at_rudder + way * (rudder - at_rudder), at_elevator + way * (elevator - at_elevator)
    return health._replace(duct_expected=follows)


def troubles(health: Health) -> dict[str, str]:
    """What is believed to be wrong, by subject."""
    return {doubt.complaint.subject: doubt.complaint.what for doubt in health.doubts if doubt.told}


def refusal(health: Health) -> str:
    """Why she must not be armed; empty when she may."""
    reasons = (f"{name} {what}" for name, what in troubles(health).items() if name in VITAL)
    return next(reasons, "")


def fixed(health: Health, time_us: int) -> bool:
    """Whether a satellite fix came in this tick."""
    return health.gps.sound_us == time_us and _is_fix(health.gps.record)


def _excluded(health: Health) -> frozenset[str]:
    """Whose readings are not used: nonsense at the first sign, but what is only silent is believed when it speaks."""
    return frozenset(
        doubt.complaint.subject
        for doubt in health.doubts
        if (what := doubt.latest or doubt.complaint.what) == IMPLAUSIBLE or (doubt.told and what != SILENT)
    )


def _weigh(
    doubts: tuple[Doubt, ...], complaints: tuple[Complaint, ...], now_us: int, config: Config
) -> tuple[tuple[Doubt, ...], tuple[Event, ...]]:
    """The doubts after the complaints of a tick, with what is to be told: each loss and each recovery once."""
    open_doubts = {doubt.complaint.subject: doubt for doubt in doubts}
    for complaint in complaints:
        old = open_doubts.get(complaint.subject)
        if old is None:
            open_doubts[complaint.subject] = Doubt(complaint, now_us, now_us)
        elif old.last_us < now_us:
            kept = old.complaint if old.told or old.complaint.what != SILENT else complaint
            open_doubts[complaint.subject] = old._replace(
                complaint=kept, last_us=now_us, times=old.times + 1, latest=complaint.what
            )
    events: list[Event] = []
    weighed: list[Doubt] = []
    for doubt in open_doubts.values():
        quiet_us = now_us - doubt.last_us
        grace_us = IMPLAUSIBLE_GRACE_US if doubt.complaint.what == IMPLAUSIBLE else GRACE_US
        if doubt.told and quiet_us > RECOVERY_US:
            events.append(Event(Severity.NOTICE, f"{doubt.complaint.subject} recovered"))
        elif doubt.told or quiet_us <= grace_us:
            weighed.append(_judged(doubt, now_us, config, events))
    return tuple(weighed), tuple(events)


def _judged(doubt: Doubt, now_us: int, config: Config, events: list[Event]) -> Doubt:
    """The doubt, believed and told when it has lasted."""
    complaint = doubt.complaint
    patience = _PATIENCE.get(complaint.what, _AT_ONCE)
    if complaint.what == UNANSWERED:
        patience = Patience(2, round(config.health_depth_s * US_PER_S))
    if doubt.told or doubt.times < patience.times or now_us - doubt.since_us < patience.lasting_us:
        return doubt
    severity = Severity.EMERGENCY if complaint.subject == LEAK else Severity.ERROR
    events.append(Event(severity, f"{complaint.subject} {complaint.what}"))
    return doubt._replace(told=True)


def _hear_devices(
    health: Health, inputs: Inputs, state: State, excluded: frozenset[str]
) -> tuple[Health, Inputs, tuple[Complaint, ...]]:
    """Take in what devices say; a record that cannot be, or that nobody believes any more, goes no further."""
    now_us, complaints = inputs.sensors.time_us, []
    if inputs.gps is not None:
        deep = state.estimate.depth_m > 2.0 * _SURFACED_M
        health = health._replace(gps_under_water=health.gps_under_water or deep)
    for field, name, possible, said in _DEVICES:
        record = getattr(inputs, field)
        if record is None:
            continue
        old: Device = getattr(health, field)
        lately = old.record if now_us - old.sound_us < JUMP_WITHIN_US else None
        sound = possible(record, lately)
        if sound:
            same = old.record is not None and said(record) == said(old.record)
            new = Device(record, now_us, now_us, old.changed_us if same else now_us)
        else:
            complaints.append(Complaint(name, IMPLAUSIBLE))
            new = old._replace(heard_us=now_us, changed_us=now_us)
        health = _with(health, field, new)
        if not sound or name in excluded:
            inputs = _without(inputs, field)
    return health, inputs, tuple(complaints)


def _with(health: Health, field: str, device: Device) -> Health:
    one: dict[str, Any] = {field: device}
    return health._replace(**one)


def _without(inputs: Inputs, field: str) -> Inputs:
    none: dict[str, Any] = {field: None}
    return inputs._replace(**none)


def _slow_complaints(health: Health, state: State, now_us: int, config: Config) -> tuple[Complaint, ...]:
    """What is only worth a look now and then: silence, standing still, and what does not answer."""
    found = [
        Complaint(name, what)
        for name, what, true in (
            (GPS, SILENT, _gps_expected(health, state, config) and _silent(health.gps, now_us, DEVICE_SILENT_US)),
            (GPS, STUCK, _is_fix(health.gps.record) and _stuck(health.gps, now_us)),
            (ALTIMETER, SILENT, _echo_expected(health, state) and _silent(health.altimeter, now_us, DEVICE_SILENT_US)),
            (ALTIMETER, STUCK, _stuck(health.altimeter, now_us)),
            (DVL, SILENT, _silent(health.dvl, now_us, DEVICE_SILENT_US)),
            (DVL, STUCK, _stuck(health.dvl, now_us)),
            (BATTERY, SILENT, _silent(health.battery, now_us, BATTERY_SILENT_US)),
            (BATTERY, LOW, _low(health.battery.record, config)),
            (LEAK, DETECTED, _wet(health.leak.record)),
            (DUCT, SILENT, _silent(health.duct, now_us, DEVICE_SILENT_US)),
            (DUCT, ASTRAY, _astray(health, config)),
            (DEPTH, UNANSWERED, _unanswered(state, config)),
        )
        if true
    ]
    return tuple(found)


def _silent(device: Device, now_us: int, limit_us: int) -> bool:
    return 0 <= device.heard_us < now_us - limit_us


def _stuck(device: Device, now_us: int) -> bool:
    """Still speaking, and saying the same."""
    return device.heard_us - device.changed_us > DEVICE_STUCK_US and now_us - device.heard_us < GRACE_US


def _gps_expected(health: Health, state: State, config: Config) -> bool:
    return health.gps_under_water or state.estimate.depth_m < config.surfaced_depth_m


def _is_fix(fix: GpsFix | None) -> bool:
    return fix is not None and fix.fix_type >= 3


def _echo_expected(health: Health, state: State) -> bool:
    """The floor was well within reach when it was last seen, and nothing says that it no longer is."""
    last: Altimeter | None = health.altimeter.record
    at = state.estimate
    return last is not None and last.range_m < 0.7 * last.max_range_m and abs(at.pitch_rad) < math.radians(30.0)


def _low(battery: Battery | None, config: Config) -> bool:
    if battery is None:
        return False
    return 100.0 * battery.remaining < config.fs_battery_pct or battery.voltage_v < config.fs_battery_v


def _wet(leak: Leak | None) -> bool:
    return leak is not None and leak.wet


def _astray(health: Health, config: Config) -> bool:
    seen: DuctFeedback | None = health.duct.record
    rudder, elevator = health.duct_expected
    if seen is None:
        return False
    return 100.0 * max(abs(seen.rudder - rudder), abs(seen.elevator - elevator)) > config.health_duct_pct


def _unanswered(state: State, config: Config) -> bool:
    """Under way in a mode that holds depth, the depth far off and not coming nearer."""
    mode = modes.by_number(state.mode)
    if not (state.armed and mode and mode.closes_depth and config.health_depth_s and state.thrust > ASKED_THRUST):
        return False
    error_m = state.setpoint.depth_m - state.estimate.depth_m
    return abs(error_m) > ASKED_DEPTH_M and math.copysign(1.0, error_m) * state.estimate.depth_rate_mps < MOVING_MPS


def _possible_fix(fix: GpsFix, before: GpsFix | None) -> bool:
    if fix.fix_type < 3 or before is None or before.fix_type < 3:
        return abs(fix.lat_deg) <= 90.0 and abs(fix.lon_deg) <= 180.0
    north_m = _METRES_PER_DEG * (fix.lat_deg - before.lat_deg)
    east_m = _METRES_PER_DEG * (fix.lon_deg - before.lon_deg) * math.cos(math.radians(fix.lat_deg))
    return math.hypot(north_m, east_m) < FIX_JUMP_M


def _possible_echo(echo: Altimeter, before: Altimeter | None) -> bool:
    if not echo.min_range_m <= echo.range_m <= echo.max_range_m:
        return False
    return before is None or abs(echo.range_m - before.range_m) < ECHO_JUMP_M


def _possible_velocity(seen: Dvl, before: Dvl | None) -> bool:
    now = seen.velocity_x_mps, seen.velocity_y_mps, seen.velocity_z_mps
    if not all(abs(v) < 10.0 for v in now):
        return False
    if before is None or before.over_ground != seen.over_ground:
        return True
    then = before.velocity_x_mps, before.velocity_y_mps, before.velocity_z_mps
    return all(abs(a - b) < DVL_JUMP_MPS for a, b in zip(now, then, strict=True))


def _possible_charge(seen: Battery, before: Battery | None) -> bool:
    return seen.voltage_v > 0.0 and not abs(seen.remaining - (before.remaining if before else seen.remaining)) > 0.2


def _any(seen: object, before: object) -> bool:
    return True


def _whole(record: object) -> object:
    return record


_DEVICES: tuple[tuple[str, str, Callable[[Any, Any], bool], Callable[[Any], object]], ...] = (
    ("gps", GPS, _possible_fix, lambda fix: (fix.lat_deg, fix.lon_deg)),
    ("altimeter", ALTIMETER, _possible_echo, lambda echo: echo.range_m),
    ("dvl", DVL, _possible_velocity, lambda seen: (seen.velocity_x_mps, seen.velocity_y_mps, seen.velocity_z_mps)),
    ("battery", BATTERY, _possible_charge, _whole),
    ("leak", LEAK, _any, _whole),
    ("duct", DUCT, _any, _whole),
)
"""Field of ``Inputs`` and ``Health``, name, whether a record can be after another, and what stands still when stuck."""
_SURFACED_M = 0.5
_NOBODY: frozenset[str] = frozenset()
