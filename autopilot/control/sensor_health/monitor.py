"""Sensor monitor: collect the faults of all sensors, confirm them and report them. Pure.

Part of the tick. A suspected fault that persists is confirmed. A confirmed fault is reported once,
clears a bit of SYS_STATUS, prevents arming if the subject is vital, and excludes the sensor until
no new evidence has come for ``RECOVERY_US``.
"""

import math
from itertools import compress
from typing import NamedTuple

from autopilot.control import modes
from autopilot.control.params import Config
from autopilot.control.sensor_health import cross_checks, imu_checks, sensor_checks
from autopilot.control.sensor_health.imu_checks import IMPLAUSIBLE, SILENT, STUCK
from autopilot.control.sensor_health.sensor_checks import (
    ALTIMETER,
    BATTERY,
    DUCT,
    DVL,
    GPS,
    LEAK,
)
from autopilot.control.sensor_health.types import (
    Ahrs,
    Device,
    Devices,
    Fault,
    FaultTracker,
    Health,
)
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Event,
    Inputs,
    Severity,
    VehicleEstimate,
)
from mavlink_io.jit import numeric
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    ATTITUDE_FRESH,
    GYRO_FRESH,
    PRESSURE_FRESH,
    SensorFrame,
)

ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE = (group.name for group in imu_checks.GROUPS)
DEPTH = "Depth"
SENSORS = "Sensors"
"""Subject of a fault of the whole sensor frame: the HIL link is silent."""
VITAL = frozenset((ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE, SENSORS, BATTERY, LEAK, DUCT))
"""Subjects whose fault prevents arming."""
ELEVATOR, RUDDER, PITCH = "Elevator", "Rudder", "Pitch"
"""Subjects of faults that the vehicle's motion shows: the duct, or the attitude that it follows."""
LASTING = frozenset((ELEVATOR, PITCH))
"""Subjects whose fault lasts until the next arming: without thrust there is no evidence of it."""
DETECTED, LOW, DEVIATES, NOT_TRACKING = "detected", "low", "does not follow", "not tracking"
NO_EFFECT, DISAGREES, LAGS = "has no effect", "disagrees", "does not show a descent"
HEADING, SPEED = "Heading", "Speed"
"""Subjects of faults of heading and speed that course over ground and Doppler log show."""

RECOVERY_US = 5 * US_PER_S
"""A confirmed fault with no new evidence for longer than this is reported as recovered."""
FAULT_CLEAR_US, IMPLAUSIBLE_CLEAR_US = US_PER_S // 2, 3 * US_PER_S // 2
"""A suspected fault with no new evidence for longer than this is cleared.

Implausible readings have the longer limit: a slow sensor may send them one second apart.
"""
LASTING_CLEAR_US = 10 * US_PER_S
"""Longest time without a measured depth for which a suspected fault of ``LASTING`` is kept: a slow
pressure sensor shows it in some checks only."""
CHECK_US = US_PER_S // 5
"""Interval of the slow checks."""
DUCT_LAG_S = 0.7
"""Time constant (s) that approximates transport delay and lag of the tailcone together."""
MOVING_MPS = 0.02
"""Minimum depth rate towards the set-point of a depth that is tracked."""
SINKING_MPS, NOSE_UP_SINKING_MPS, RAISING_RADPS = 0.05, 0.1, math.radians(1.0)
"""Rate of descent with the elevator up and with the nose up, and pitch rate below which the nose
does not come up. A heavy vehicle holds its depth with its nose up; waves move it by 0.05 m/s."""
ELEVATOR_UP, NOSE_UP_RAD = 0.5, math.radians(5.0)
"""Elevator (fraction of the travel) and pitch above which a vehicle must not sink."""
MAX_CLIMB_ERROR_MPS = 0.6
"""Rate of ascent that speed and pitch give, less the measured one, which neither heave nor the
sideslip of a vehicle that begins to climb explains: the pitch is wrong."""
TURN_DEADBAND_RADPS, RUDDER_HARD, RUDDER_CHECK_US = math.radians(0.3), 0.9, 10 * US_PER_S
"""Yaw rate that a rudder beyond this fraction of its travel must exceed, and the time it has."""
COMMANDED_THRUST_GATE, COMMANDED_DEPTH_GATE_M = 0.2, 1.0
"""Thrust (fraction of full) and depth error (m) above which the depth must approach its
set-point."""
SUBMERGED_M = 1.0
"""Depth below which no satellite is received: a receiver that reports there always reports."""
OFF_DEPTH, OFF_DEPTH_CHECKS = Fault(DEPTH, NOT_TRACKING), 2
"""Fault of a depth that does not approach its set-point, and the number of slow checks that have to
find it."""
LAG_US = 8 * US_PER_S
"""Time for which the measured depth has to lag behind a descent: the start of a dive takes 3 s."""
NEVER_US = 2**62
"""A time that does not come."""
ECHO_TILT_LIMIT_RAD = math.radians(30.0)
"""Maximum pitch at which the altimeter is expected to detect the sea floor."""


class Debounce(NamedTuple):
    """Evidence that confirms a suspected fault."""

    detections: int
    """Minimum number of ticks in which the fault was detected."""
    duration_us: int
    """Minimum time since the fault was first detected."""


_VERTICAL_FIELDS = ACCELEROMETER_FRESH | PRESSURE_FRESH
_IMMEDIATE = Debounce(1, 0)
_DEBOUNCE = {
    IMPLAUSIBLE: Debounce(5, 0),
    LOW: Debounce(5, US_PER_S),
    DEVIATES: Debounce(5, 2 * US_PER_S),
    DISAGREES: Debounce(10, 3 * US_PER_S),
    LAGS: Debounce(25, LAG_US),
}
_GYRO_DISAGREES = Debounce(5, US_PER_S)
"""Evidence against a gyro, shorter than for other sensors: the loops follow its rate at once."""

_NO_SUBJECTS: frozenset[str] = frozenset()

SensorCheckResult = tuple[Ahrs, Health, Inputs, tuple[Event, ...]]


def check_sensors(state: AutopilotState, inputs: Inputs, config: Config) -> SensorCheckResult:
    """Check all sensors of a tick.

    Parameters
    ----------
    state : AutopilotState
        State after the last tick.
    inputs : Inputs
        Inputs of this tick, as received.
    config : Config
        Parameters.

    Returns
    -------
    SensorCheckResult
        The history of the sensor frame, the history of the other sensors with their faults, the
        inputs without the readings that must not be used, and the events to send. In the sensor
        frame returned, ``fields_updated`` names the groups that may be used.
    """
    health, now_us = state.health, inputs.sensors.time_us
    depth_checked = False
    excluded = _excluded_subjects(health) if health.faults else _NO_SUBJECTS
    ahrs, sample, detected = imu_checks.check_imu(state.ahrs, inputs.sensors, excluded, config)
    if sample is not inputs.sensors:
        inputs = inputs._replace(sensors=sample)
    if sensor_checks.has_data(inputs):
        health, inputs, implausible = sensor_checks.update(health, inputs, excluded)
        detected += implausible
    if now_us >= health.check_us:
        detected += _slow_checks(state._replace(health=health), now_us, config)
        detected += _cross_checks(health, state, now_us, config)
        wet_gps = state.armed and fix_while_submerged(health.devices, state.estimate, now_us)
        if wet_gps:
            health = health._replace(devices=health.devices._replace(gps_under_water=True))
        health = health._replace(check_us=now_us + CHECK_US)
        depth_checked = _depth_counts(state, config)
    if not detected and not health.faults:
        return ahrs, health, inputs, ()
    trackers, events = _update_trackers(health.faults, detected, now_us, config, depth_checked)
    return ahrs, health._replace(faults=trackers), inputs, events


@numeric
def predict_duct(
    duct_rad: tuple[float, float], rudder_rad: float, elevator_rad: float, dt_s: float
) -> tuple[float, float]:
    """Predict the duct's angles after a tick, to compare with its feedback.

    First-order lag, explicit Euler: ``delta <- delta + dt / T (command - delta)`` with
    T = ``DUCT_LAG_S``; ``dt_s`` must be less than T.

    Parameters
    ----------
    duct_rad : tuple[float, float]
        Predicted rudder and elevator angle before the tick.
    rudder_rad, elevator_rad : float
        Commanded angles, positive turns the nose to starboard and up.
    dt_s : float
        Length of the tick.

    Returns
    -------
    tuple[float, float]
        Predicted rudder and elevator angle (rad) after the tick.
    """
    alpha, (rudder, elevator) = dt_s / DUCT_LAG_S, duct_rad
    return rudder + alpha * (rudder_rad - rudder), elevator + alpha * (elevator_rad - elevator)


def active_faults(health: Health) -> dict[str, str]:
    """Return the confirmed faults: what is wrong, by subject."""
    return {
        tracker.fault.subject: tracker.fault.what for tracker in health.faults if tracker.reported
    }


def prearm_failure(health: Health) -> str:
    """Return the first confirmed fault that prevents arming; empty if there is none."""
    reasons = (f"{name} {what}" for name, what in active_faults(health).items() if name in VITAL)
    return next(reasons, "")


def report_sensor_loss(state: AutopilotState) -> AutopilotState:
    """Return the state after the sensor frames have stopped.

    The fault is confirmed at once; it ends when frames have come again for ``RECOVERY_US``. The
    history of the frames is cleared: after a gap the next frame may repeat the last one without
    being stuck, and may differ from it by any amount.
    """
    others = tuple(tracker for tracker in state.health.faults if tracker.fault.subject != SENSORS)
    lost = FaultTracker(Fault(SENSORS, SILENT), state.time_us, state.time_us, reported=True)
    return state._replace(ahrs=Ahrs(), health=state.health._replace(faults=(*others, lost)))


def begin_dive(health: Health, frame: SensorFrame) -> Health:
    """Return the history at arming.

    The magnetic field becomes the reference of later readings, and the faults of ``LASTING`` end.

    Parameters
    ----------
    health : Health
        History before arming.
    frame : SensorFrame
        Present sensor frame.

    Returns
    -------
    Health
        History after arming.
    """
    others = tuple(tracker for tracker in health.faults if tracker.fault.subject not in LASTING)
    return health._replace(field_gauss=cross_checks.field_of(frame), faults=others)


def has_new_fix(health: Health, time_us: int) -> bool:
    """Return whether a satellite fix was accepted in the tick at ``time_us``."""
    gps = health.devices.gps
    return gps.accepted_us == time_us and sensor_checks.has_position(gps)


def _excluded_subjects(health: Health) -> frozenset[str]:
    """Return the sensors whose readings are not used.

    An implausible reading excludes at once, and a sensor that disagrees after it stays excluded;
    any other fault excludes once it is confirmed. A silent sensor is not excluded: its next reading
    is used.
    """
    return frozenset(
        tracker.fault.subject
        for tracker in health.faults
        if (what := tracker.latest or tracker.fault.what) == IMPLAUSIBLE
        or (tracker.reported and what != SILENT)
        or (tracker.fault.what == IMPLAUSIBLE and what == DISAGREES)
    )


def _update_trackers(
    trackers: tuple[FaultTracker, ...],
    detected: tuple[Fault, ...],
    now_us: int,
    config: Config,
    depth_checked: bool,
) -> tuple[tuple[FaultTracker, ...], tuple[Event, ...]]:
    """Add the faults of a tick; report each confirmed fault and each recovery once.

    ``depth_checked`` is whether a slow check with a measured depth was done: only that one clears
    a suspected fault of ``LASTING``.
    """
    by_subject = {tracker.fault.subject: tracker for tracker in trackers}
    for fault in detected:
        old = by_subject.get(fault.subject)
        if old is None:
            by_subject[fault.subject] = FaultTracker(fault, now_us, now_us)
        elif old.last_us < now_us:
            main = old.fault if old.reported or old.fault.what != SILENT else fault
            by_subject[fault.subject] = old._replace(
                fault=main, last_us=now_us, detections=old.detections + 1, latest=fault.what
            )
    events: list[Event] = []
    remaining: list[FaultTracker] = []
    for tracker in by_subject.values():
        quiet_us = now_us - tracker.last_us
        clear_us = _clear_us(tracker.fault)
        if tracker.fault.subject in LASTING and not depth_checked:
            clear_us = LASTING_CLEAR_US
        if tracker.reported and quiet_us > RECOVERY_US and tracker.fault.subject not in LASTING:
            events.append(Event(Severity.NOTICE, f"{tracker.fault.subject} recovered"))
        elif tracker.reported or quiet_us <= clear_us:
            remaining.append(_confirm_fault(tracker, now_us, config, events))
    return tuple(remaining), tuple(events)


def _confirm_fault(
    tracker: FaultTracker, now_us: int, config: Config, events: list[Event]
) -> FaultTracker:
    """Confirm and report a fault that has persisted; append its event to ``events``."""
    fault = tracker.fault
    debounce = _debounce(fault, config)
    known_us = tracker.last_us if fault.subject in LASTING else now_us
    if (
        tracker.reported
        or tracker.detections < debounce.detections
        or known_us - tracker.since_us < debounce.duration_us
    ):
        return tracker
    severity = Severity.EMERGENCY if fault.subject == LEAK else Severity.ERROR
    events.append(Event(severity, f"{fault.subject} {fault.what}"))
    return tracker._replace(reported=True)


def _debounce(fault: Fault, config: Config) -> Debounce:
    """Return the evidence that confirms a fault."""
    if fault.what == NOT_TRACKING:
        return Debounce(OFF_DEPTH_CHECKS, round(config.health_depth_s * US_PER_S))
    if fault.subject in LASTING:
        return Debounce(OFF_DEPTH_CHECKS, round(config.fs_dive_s * US_PER_S))
    if fault.subject == RUDDER:
        return Debounce(OFF_DEPTH_CHECKS, RUDDER_CHECK_US)
    if fault == Fault(GYRO, DISAGREES):
        return _GYRO_DISAGREES
    return _DEBOUNCE.get(fault.what, _IMMEDIATE)


def _clear_us(fault: Fault) -> int:
    """Return the time without new evidence after which a suspected fault is cleared."""
    return IMPLAUSIBLE_CLEAR_US if fault.what == IMPLAUSIBLE else FAULT_CLEAR_US


def confirm_us(tracker: FaultTracker, config: Config) -> int:
    """Return the first time at which a suspected fault may be confirmed."""
    return tracker.since_us + _debounce(tracker.fault, config).duration_us


def settled_until_us(health: Health, config: Config) -> int:
    """Return the time until which suspected faults stay as they are without new evidence.

    Parameters
    ----------
    health : Health
        History of the sensors.
    config : Config
        Parameter HLTH_DPT_S.

    Returns
    -------
    int
        The first time at which a fault may be confirmed or cleared; -1 if a fault is confirmed or
        excludes a sensor already.
    """
    until_us = NEVER_US
    for tracker in health.faults:
        if tracker.reported or IMPLAUSIBLE in (tracker.fault.what, tracker.latest):
            return -1
        if tracker.detections >= _debounce(tracker.fault, config).detections:
            until_us = min(until_us, confirm_us(tracker, config))
        until_us = min(until_us, tracker.last_us + _clear_us(tracker.fault) + 1)
    return until_us


_DEVICE_FAULTS = (
    Fault(GPS, SILENT),
    Fault(GPS, STUCK),
    Fault(ALTIMETER, SILENT),
    Fault(ALTIMETER, STUCK),
    Fault(DVL, SILENT),
    Fault(DVL, STUCK),
    Fault(BATTERY, SILENT),
    Fault(BATTERY, LOW),
    Fault(LEAK, DETECTED),
    Fault(DUCT, SILENT),
    Fault(DUCT, DEVIATES),
)
"""Faults of ``check_devices``, in its order."""


def _slow_checks(state: AutopilotState, now_us: int, config: Config) -> tuple[Fault, ...]:
    """Return the faults that change slowly: silent, stuck, low, leak and deviations."""
    devices, estimate = state.health.devices, state.estimate
    present = check_devices(devices, estimate, state.duct_rad, now_us, config)
    found = list(compress(_DEVICE_FAULTS, present))
    if _depth_not_tracking(state, config):
        found.append(OFF_DEPTH)
    if _dive_not_stopped(state, config):
        found.append(Fault(ELEVATOR, NO_EFFECT))
    if _pitch_contradicted(state, config):
        found.append(Fault(PITCH, DISAGREES))
    if _depth_counts(state, config) and depth_lags(devices, estimate, now_us):
        found.append(Fault(PRESSURE, LAGS))
    if state.armed and turns_away(estimate, state.duct_rad, state.thrust, config):
        found.append(Fault(RUDDER, NO_EFFECT))
    return tuple(found)


@numeric
def check_devices(
    devices: Devices,
    estimate: VehicleEstimate,
    duct_rad: tuple[float, float],
    now_us: int,
    config: Config,
) -> tuple[bool, ...]:
    """Return which of ``_DEVICE_FAULTS`` are present.

    Parameters
    ----------
    devices : Devices
        History of the sensors.
    estimate : VehicleEstimate
        Estimate after the last tick.
    duct_rad : tuple[float, float]
        Predicted rudder and elevator angle.
    now_us : int
        Time of this tick.
    config : Config
        Parameters.
    """
    silent, stuck = sensor_checks.is_silent, sensor_checks.is_frozen
    gps, altimeter, dvl = devices.gps, devices.altimeter, devices.dvl
    battery, leak, duct = devices.battery, devices.leak, devices.duct
    default_us = sensor_checks.SILENT_US
    return (
        silent(gps, now_us, default_us) and _fix_expected(devices, estimate, config),
        stuck(gps, now_us) and sensor_checks.has_position(gps),
        silent(altimeter, now_us, default_us) and _echo_expected(altimeter, estimate),
        stuck(altimeter, now_us),
        silent(dvl, now_us, default_us),
        stuck(dvl, now_us),
        silent(battery, now_us, sensor_checks.BATTERY_SILENT_US),
        _battery_low(battery, config),
        sensor_checks.has_record(leak) and leak.record.wet,
        silent(duct, now_us, default_us),
        _duct_deviates(duct, duct_rad, config),
    )


def _cross_checks(
    health: Health, state: AutopilotState, now_us: int, config: Config
) -> tuple[Fault, ...]:
    """Return the sensors that disagree with others.

    A sensor that is named accounts for the difference of the attitude, so that the gyro is not
    named with it. One that is named only because it is silent at times does not: what it measures
    is right. A wrong attitude accounts for an acceleration along the vertical. State and frame are
    those of the last tick.
    """
    estimate, ahrs, found = state.estimate, state.ahrs, []
    frame, fresh = ahrs.frame, ahrs.frame.fields_updated
    if not estimate.initialised:
        return ()
    known = {tracker.fault.subject for tracker in health.faults if tracker.fault.what != SILENT}
    raw = cross_checks.raw_frame(ahrs)
    turned = fresh & GYRO_FRESH != 0 and cross_checks.attitude_differs(estimate, frame, config)
    upright = not (turned or GYRO in known) and fresh & _VERTICAL_FIELDS == _VERTICAL_FIELDS
    if (raw.fields_updated & ACCELEROMETER_FRESH and cross_checks.gravity_differs(raw)) or (
        upright and cross_checks.acceleration_differs(estimate)
    ):
        found.append(ACCELEROMETER)
    elif (
        ACCELEROMETER not in known
        and raw.fields_updated & ATTITUDE_FRESH == ATTITUDE_FRESH
        and cross_checks.field_differs(raw, *health.field_gauss)
    ):
        found.append(MAGNETOMETER)
    steady = not (found or known & {ACCELEROMETER, MAGNETOMETER})
    if cross_checks.gyro_differs(estimate, ahrs) or (steady and turned):
        found.append(GYRO)
    if (
        cross_checks.pressure_differs(estimate, ahrs, config)
        or cross_checks.reads_above_water(estimate, ahrs, config)
        or (not state.armed and _submerged_with_fix(health.devices, ahrs, now_us, config))
    ):
        found.append(PRESSURE)
    if doppler_disagrees(health.devices, estimate, now_us):
        ping = health.devices.dvl.record
        found.append(DVL if cross_checks.doppler_differs(estimate, ping) else SPEED)
    if course_disagrees(health.devices, estimate, now_us):
        found.append(HEADING)
    return tuple(Fault(subject, DISAGREES) for subject in found)


@numeric
def course_disagrees(devices: Devices, estimate: VehicleEstimate, now_us: int) -> bool:
    """Return whether the last satellite fix contradicts the heading (``course_differs``)."""
    gps = devices.gps
    recent = sensor_checks.has_record(gps) and now_us - gps.accepted_us < sensor_checks.SILENT_US
    return recent and cross_checks.course_differs(estimate, gps.record)


@numeric
def doppler_disagrees(devices: Devices, estimate: VehicleEstimate, now_us: int) -> bool:
    """Return whether the last Doppler log velocity contradicts the predicted speed."""
    dvl = devices.dvl
    recent = sensor_checks.has_record(dvl) and now_us - dvl.accepted_us < sensor_checks.SILENT_US
    return recent and (
        cross_checks.doppler_differs(estimate, dvl.record)
        or cross_checks.speed_differs(estimate, dvl.record)
    )


@numeric
def depth_lags(devices: Devices, estimate: VehicleEstimate, now_us: int) -> bool:
    """Return whether the last Doppler log velocity, speed and pitch show an unmeasured descent."""
    dvl = devices.dvl
    recent = sensor_checks.has_record(dvl) and now_us - dvl.accepted_us < sensor_checks.SILENT_US
    return recent and cross_checks.depth_lags(estimate, dvl.record)


def _submerged_with_fix(devices: Devices, ahrs: Ahrs, now_us: int, config: Config) -> bool:
    """Return whether a vehicle before its launch has a fix and a pressure of under water.

    A receiver that has reported under water before is not evidence.
    """
    gps = devices.gps
    return (
        sensor_checks.has_position(gps)
        and now_us - gps.accepted_us < sensor_checks.SILENT_US
        and not devices.gps_under_water
        and cross_checks.deeper_than_afloat(ahrs, config)
    )


@numeric
def fix_while_submerged(devices: Devices, estimate: VehicleEstimate, now_us: int) -> bool:
    """Return whether the receiver reported since the last slow check while submerged."""
    return 0 <= now_us - CHECK_US < devices.gps.received_us and estimate.depth_m > SUBMERGED_M


@numeric
def _fix_expected(devices: Devices, estimate: VehicleEstimate, config: Config) -> bool:
    """Return whether the receiver should report: at the surface, or if it reports at any depth."""
    return devices.gps_under_water or estimate.depth_m < config.surfaced_depth_m


@numeric
def _echo_expected(altimeter: Device, estimate: VehicleEstimate) -> bool:
    """Return whether the altimeter should report a range.

    The last range was less than 0.7 of the maximum, and the pitch is small.
    """
    return (
        sensor_checks.has_record(altimeter)
        and altimeter.record.range_m < 0.7 * altimeter.record.max_range_m
        and abs(estimate.pitch_rad) < ECHO_TILT_LIMIT_RAD
    )


@numeric
def _battery_low(battery: Device, config: Config) -> bool:
    """Return whether charge or voltage is below its limit (FS_BATT_PCT, FS_BATT_V)."""
    return sensor_checks.has_record(battery) and (
        100.0 * battery.record.remaining < config.fs_battery_pct
        or battery.record.voltage_v < config.fs_battery_v
    )


@numeric
def _duct_deviates(duct: Device, expected_rad: tuple[float, float], config: Config) -> bool:
    """Return whether the duct's feedback differs from the predicted angles by HLTH_DUCT_PCT."""
    if not sensor_checks.has_record(duct):
        return False
    travel = config.travel_rad
    rudder, elevator = expected_rad[0] / travel, expected_rad[1] / travel
    deviation = max(abs(duct.record.rudder - rudder), abs(duct.record.elevator - elevator))
    return bool(100.0 * deviation > config.health_duct_pct)


def _depth_not_tracking(state: AutopilotState, config: Config) -> bool:
    """Return whether the depth stays away from its set-point under thrust in a depth mode."""
    mode = modes.by_number(state.mode)
    return bool(
        state.armed
        and mode
        and mode.closes_depth
        and off_depth(state.estimate, state.setpoint, state.thrust, config)
    )


@numeric
def off_depth(estimate: VehicleEstimate, setpoint: Setpoint, thrust: float, config: Config) -> bool:
    """Return whether the depth does not approach its set-point under thrust.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    setpoint : Setpoint
        Set-points of a closed depth loop.
    thrust : float
        Commanded thrust (fraction of full).
    config : Config
        Parameter HLTH_DPT_S; 0 turns the check off.
    """
    if not config.health_depth_s or thrust <= COMMANDED_THRUST_GATE:
        return False
    if not math.isnan(setpoint.pitch_rad):
        return False
    error_m = setpoint.depth_m - estimate.depth_m
    return (
        abs(error_m) > COMMANDED_DEPTH_GATE_M
        and math.copysign(1.0, error_m) * estimate.depth_rate_mps < MOVING_MPS
    )


def _dive_not_stopped(state: AutopilotState, config: Config) -> bool:
    """Return whether the vehicle dives (``dives``), outside a test, while depth is measured."""
    return _depth_counts(state, config) and dives(
        state.estimate, state.duct_rad, state.thrust, config
    )


def _pitch_contradicted(state: AutopilotState, config: Config) -> bool:
    """Return whether ``sinks_nose_up`` while depth is measured."""
    return _depth_counts(state, config) and sinks_nose_up(state.estimate, state.thrust, config)


def _depth_counts(state: AutopilotState, config: Config) -> bool:
    """Return whether the vehicle is armed and its depth was measured in the last HLTH_LOST_S."""
    unmeasured_us = state.time_us - state.estimate.depth_time_us
    return state.armed and unmeasured_us <= config.health_lost_s * US_PER_S


@numeric
def sinks_nose_up(estimate: VehicleEstimate, thrust: float, config: Config) -> bool:
    """Return whether the vehicle sinks although speed and pitch should raise it.

    With U the predicted speed, theta the pitch and w the measured rate of descent: w > 0 and
    U sin(theta) + w > ``MAX_CLIMB_ERROR_MPS``. The pitch is wrong, or there is no thrust.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    thrust : float
        Commanded thrust (fraction of full).
    config : Config
        Parameter FS_DIVE_S; 0 turns the check off.
    """
    if not config.fs_dive_s or thrust <= COMMANDED_THRUST_GATE:
        return False
    climb_mps = estimate.speed_mps * math.sin(estimate.pitch_rad)
    contradicted = climb_mps > 0.0 and climb_mps + estimate.depth_rate_mps > MAX_CLIMB_ERROR_MPS
    return contradicted and _sinks_with_nose_up(estimate)


@numeric
def _sinks_with_nose_up(estimate: VehicleEstimate) -> bool:
    """Return whether the vehicle sinks although its nose points up."""
    nose_up = estimate.pitch_rad > NOSE_UP_RAD
    return nose_up and estimate.depth_rate_mps > NOSE_UP_SINKING_MPS


@numeric
def dives(
    estimate: VehicleEstimate, duct_rad: tuple[float, float], thrust: float, config: Config
) -> bool:
    """Return whether the vehicle sinks although elevator or pitch point up, and does not pitch up.

    Either the elevator does not act, or pitch or depth is measured wrongly.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    duct_rad : tuple[float, float]
        Rudder and elevator angle that the commands predict.
    thrust : float
        Commanded thrust (fraction of full).
    config : Config
        Parameter FS_DIVE_S; 0 turns the check off.
    """
    if not config.fs_dive_s or thrust <= COMMANDED_THRUST_GATE:
        return False
    rate_mps = estimate.depth_rate_mps
    elevator_up = duct_rad[1] > ELEVATOR_UP * config.travel_rad and rate_mps > SINKING_MPS
    return (elevator_up or _sinks_with_nose_up(estimate)) and estimate.q_radps < RAISING_RADPS


@numeric
def turns_away(
    estimate: VehicleEstimate, duct_rad: tuple[float, float], thrust: float, config: Config
) -> bool:
    """Return whether the vehicle does not turn towards a rudder that is hard over.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    duct_rad : tuple[float, float]
        Rudder and elevator angle that the commands predict.
    thrust : float
        Commanded thrust (fraction of full).
    config : Config
        Parameters.
    """
    rudder_rad = duct_rad[0]
    if thrust <= COMMANDED_THRUST_GATE or abs(rudder_rad) < RUDDER_HARD * config.travel_rad:
        return False
    return math.copysign(1.0, rudder_rad) * estimate.r_radps < TURN_DEADBAND_RADPS
