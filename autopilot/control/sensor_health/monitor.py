"""What is wrong on board, by what the vehicle herself can see: pure, part of the tick.

A complaint that lasts is believed: it is told once, clears a health bit, refuses arming, and its
instrument is no longer listened to until it has been sound for a while."""

import math
from typing import NamedTuple

from autopilot.control import modes
from autopilot.control.params import Config
from autopilot.control.sensor_health import imu_checks, sensor_checks
from autopilot.control.sensor_health.imu_checks import IMPLAUSIBLE, SILENT, STUCK
from autopilot.control.sensor_health.sensor_checks import (
    ALTIMETER,
    BATTERY,
    DUCT,
    DVL,
    GPS,
    LEAK,
)
from autopilot.control.sensor_health.types import Ahrs, Fault, FaultTracker, Health
from autopilot.control.types import US_PER_S, AutopilotState, Event, Inputs, Severity
from mavlink_io.records import Altimeter, Battery, DuctFeedback, Leak

ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE = (group.name for group in imu_checks.GROUPS)
DEPTH = "Depth"
SENSORS = "Sensors"
"""All at once: the line to them."""
VITAL = frozenset((ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE, SENSORS, BATTERY, LEAK, DUCT))
"""Nobody should go to sea without."""
DETECTED, LOW, DEVIATES, NOT_TRACKING = "detected", "low", "does not follow", "does not answer"

RECOVERY_US = 5 * US_PER_S
"""Soundness that lasts for so long is believed."""
FAULT_CLEAR_US, IMPLAUSIBLE_CLEAR_US = US_PER_S // 2, 3 * US_PER_S // 2
"""A doubt that nothing has nourished for so long is dropped; implausible readings may come a second
apart."""
CHECK_US = US_PER_S // 5
DUCT_LAG_S = 0.7
"""Transport delay and lag of the tailcone together."""
MOVING_MPS = 0.02
COMMANDED_THRUST_GATE, COMMANDED_DEPTH_GATE_M = 0.2, 1.0
"""From here on a depth that stays away is expected to come."""
SUBMERGED_M = 1.0
"""Here no satellite is seen: a receiver that speaks speaks always."""
ECHO_TILT_LIMIT_RAD = math.radians(30.0)
"""An altimeter that looks so far ahead or astern need not see the floor."""


class Debounce(NamedTuple):
    """How often and how long a complaint must be heard before it is believed."""

    times: int
    lasting_us: int


_IMMEDIATE = Debounce(1, 0)
_DEBOUNCE = {
    IMPLAUSIBLE: Debounce(5, 0),
    LOW: Debounce(5, US_PER_S),
    DEVIATES: Debounce(5, 2 * US_PER_S),
}

_NO_SUBJECTS: frozenset[str] = frozenset()

SensorCheckResult = tuple[Ahrs, Health, Inputs, tuple[Event, ...]]


def check_sensors(state: AutopilotState, inputs: Inputs, config: Config) -> SensorCheckResult:
    """Take in what the instruments say: the memory, what may be believed of it, and what to tell.

    ``fields_updated`` of the sample that is given back names the groups that may be used.
    """
    health, now_us = state.health, inputs.sensors.time_us
    excluded = _exclude_faulty(health) if health.doubts else _NO_SUBJECTS
    heard, sample, complaints = imu_checks.check_imu(state.ahrs, inputs.sensors, excluded, config)
    if sample is not inputs.sensors:
        inputs = inputs._replace(sensors=sample)
    if sensor_checks.has_data(inputs):
        health, inputs, wrong = sensor_checks.update(health, inputs, excluded)
        complaints += wrong
    if now_us >= health.check_us:
        complaints += _slow_checks(health, state, now_us, config)
        wet_gps = health.gps_under_water or _fix_while_submerged(health, state, now_us)
        health = health._replace(check_us=now_us + CHECK_US, gps_under_water=wet_gps)
    if not complaints and not health.doubts:
        return heard, health, inputs, ()
    doubts, events = _update_trackers(health.doubts, complaints, now_us, config)
    return heard, health._replace(doubts=doubts), inputs, events


def predict_duct(
    duct_rad: tuple[float, float], rudder_rad: float, elevator_rad: float, dt_s: float
) -> tuple[float, float]:
    """Where the duct should stand after a tick, shorter than its lag, in which it was told to go
    there."""
    way, (rudder, elevator) = dt_s / DUCT_LAG_S, duct_rad
    return rudder + way * (rudder_rad - rudder), elevator + way * (elevator_rad - elevator)


def active_faults(health: Health) -> dict[str, str]:
    """What is believed to be wrong, by subject."""
    return {doubt.complaint.subject: doubt.complaint.what for doubt in health.doubts if doubt.told}


def prearm_failure(health: Health) -> str:
    """Why she must not be armed; empty when she may."""
    reasons = (f"{name} {what}" for name, what in active_faults(health).items() if name in VITAL)
    return next(reasons, "")


def report_sensor_loss(state: AutopilotState) -> AutopilotState:
    """No sample comes any more: believed at once, and until they have come again for
    ``RECOVERY_US``.

    The next one may look like the last without being stuck, and differ by anything.
    """
    others = tuple(doubt for doubt in state.health.doubts if doubt.complaint.subject != SENSORS)
    lost = FaultTracker(Fault(SENSORS, SILENT), state.time_us, state.time_us, told=True)
    return state._replace(ahrs=Ahrs(), health=state.health._replace(doubts=(*others, lost)))


def has_new_fix(health: Health, time_us: int) -> bool:
    """Whether a satellite fix came in this tick."""
    return health.gps.sound_us == time_us and sensor_checks.has_fix(health.gps.record)


def _exclude_faulty(health: Health) -> frozenset[str]:
    """Whose readings are not used: nonsense at the first sign, but what is only silent is believed
    when it speaks."""
    return frozenset(
        doubt.complaint.subject
        for doubt in health.doubts
        if (what := doubt.latest or doubt.complaint.what) == IMPLAUSIBLE
        or (doubt.told and what != SILENT)
    )


def _update_trackers(
    doubts: tuple[FaultTracker, ...], complaints: tuple[Fault, ...], now_us: int, config: Config
) -> tuple[tuple[FaultTracker, ...], tuple[Event, ...]]:
    """The doubts after the complaints of a tick, with what is to be told: each loss and each
    recovery once."""
    open_doubts = {doubt.complaint.subject: doubt for doubt in doubts}
    for complaint in complaints:
        old = open_doubts.get(complaint.subject)
        if old is None:
            open_doubts[complaint.subject] = FaultTracker(complaint, now_us, now_us)
        elif old.last_us < now_us:
            kept = old.complaint if old.told or old.complaint.what != SILENT else complaint
            open_doubts[complaint.subject] = old._replace(
                complaint=kept, last_us=now_us, times=old.times + 1, latest=complaint.what
            )
    events: list[Event] = []
    weighed: list[FaultTracker] = []
    for doubt in open_doubts.values():
        quiet_us = now_us - doubt.last_us
        grace_us = IMPLAUSIBLE_CLEAR_US if doubt.complaint.what == IMPLAUSIBLE else FAULT_CLEAR_US
        if doubt.told and quiet_us > RECOVERY_US:
            events.append(Event(Severity.NOTICE, f"{doubt.complaint.subject} recovered"))
        elif doubt.told or quiet_us <= grace_us:
            weighed.append(_confirm_faults(doubt, now_us, config, events))
    return tuple(weighed), tuple(events)


def _confirm_faults(
    doubt: FaultTracker, now_us: int, config: Config, events: list[Event]
) -> FaultTracker:
    """The doubt, believed and told when it has lasted."""
    complaint = doubt.complaint
    patience = _DEBOUNCE.get(complaint.what, _IMMEDIATE)
    if complaint.what == NOT_TRACKING:
        patience = Debounce(2, round(config.health_depth_s * US_PER_S))
    if doubt.told or doubt.times < patience.times or now_us - doubt.since_us < patience.lasting_us:
        return doubt
    severity = Severity.EMERGENCY if complaint.subject == LEAK else Severity.ERROR
    events.append(Event(severity, f"{complaint.subject} {complaint.what}"))
    return doubt._replace(told=True)


def _slow_checks(
    health: Health, state: AutopilotState, now_us: int, config: Config
) -> tuple[Fault, ...]:
    """What is only worth a look now and then: silence, standing still, and what does not answer."""
    silent, stuck = sensor_checks.is_silent, sensor_checks.is_frozen
    looks = (
        (GPS, SILENT, silent(health.gps, now_us) and _fix_expected(health, state, config)),
        (GPS, STUCK, stuck(health.gps, now_us) and sensor_checks.has_fix(health.gps.record)),
        (ALTIMETER, SILENT, silent(health.altimeter, now_us) and _echo_expected(health, state)),
        (ALTIMETER, STUCK, stuck(health.altimeter, now_us)),
        (DVL, SILENT, silent(health.dvl, now_us)),
        (DVL, STUCK, stuck(health.dvl, now_us)),
        (BATTERY, SILENT, silent(health.battery, now_us, sensor_checks.BATTERY_SILENT_US)),
        (BATTERY, LOW, _battery_low(health.battery.record, config)),
        (LEAK, DETECTED, _leak_detected(health.leak.record)),
        (DUCT, SILENT, silent(health.duct, now_us)),
        (DUCT, DEVIATES, _duct_deviates(health.duct.record, state.duct_rad, config)),
        (DEPTH, NOT_TRACKING, _depth_not_tracking(state, config)),
    )
    return tuple(Fault(name, what) for name, what, wrong in looks if wrong)


def _fix_while_submerged(health: Health, state: AutopilotState, now_us: int) -> bool:
    return 0 <= now_us - CHECK_US < health.gps.heard_us and state.estimate.depth_m > SUBMERGED_M


def _fix_expected(health: Health, state: AutopilotState, config: Config) -> bool:
    return health.gps_under_water or state.estimate.depth_m < config.surfaced_depth_m


def _echo_expected(health: Health, state: AutopilotState) -> bool:
    """The floor was well within reach when it was last seen, and nothing says that it no longer
    is."""
    last: Altimeter | None = health.altimeter.record
    return (
        last is not None
        and last.range_m < 0.7 * last.max_range_m
        and abs(state.estimate.pitch_rad) < ECHO_TILT_LIMIT_RAD
    )


def _battery_low(battery: Battery | None, config: Config) -> bool:
    if battery is None:
        return False
    return (
        100.0 * battery.remaining < config.fs_battery_pct or battery.voltage_v < config.fs_battery_v
    )


def _leak_detected(leak: Leak | None) -> bool:
    return leak is not None and leak.wet


def _duct_deviates(
    seen: DuctFeedback | None, expected_rad: tuple[float, float], config: Config
) -> bool:
    if seen is None:
        return False
    travel = config.travel_rad
    rudder, elevator = expected_rad[0] / travel, expected_rad[1] / travel
    return (
        100.0 * max(abs(seen.rudder - rudder), abs(seen.elevator - elevator))
        > config.health_duct_pct
    )


def _depth_not_tracking(state: AutopilotState, config: Config) -> bool:
    """Under way in a mode that holds depth, the depth far off and not coming nearer."""
    mode = modes.by_number(state.mode)
    if not (
        state.armed
        and mode
        and mode.closes_depth
        and config.health_depth_s
        and state.thrust > COMMANDED_THRUST_GATE
    ):
        return False
    if state.setpoint.pitch_rad is not None:
        return False
    error_m = state.setpoint.depth_m - state.estimate.depth_m
    return (
        abs(error_m) > COMMANDED_DEPTH_GATE_M
        and math.copysign(1.0, error_m) * state.estimate.depth_rate_mps < MOVING_MPS
    )
