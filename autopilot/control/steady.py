"""The tick while only numbers change: no event, no new mission item, no fault.

``core.tick`` is the tick; this one is its numeric part, from the same functions, for compiled code.
It gives the same numbers, and refuses every tick in which anything else could happen: then
``core.tick`` has to run. Simulations in process use ``tick``, which knows no device beside the
sensor frame; the autopilot of a simulated vehicle uses ``tick_with_devices``.
"""

import math
from typing import NamedTuple

from autopilot.control import (
    core,
    estimator,
    excitation,
    failsafe,
    guidance,
    loops,
    mission,
    modes,
    steady_ascent,
)
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.params import Config
from autopilot.control.sensor_health import cross_checks, imu_checks, monitor, sensor_checks
from autopilot.control.sensor_health.types import (
    NO_FIELD,
    Ahrs,
    ChangeTimes,
    Devices,
    FaultTracker,
    FieldReference,
    Health,
)
from autopilot.control.setpoints import Circle, Setpoint, TrackLine
from autopilot.control.steady_ascent import NO_ASCENT, AscentTask
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Home,
    LoopMemory,
    Trace,
    VehicleEstimate,
)
from mavlink_io.device_records import (
    ALTIMETER_NEW,
    BATTERY_NEW,
    DUCT_NEW,
    DVL_NEW,
    GPS_NEW,
    LEAK_NEW,
)
from mavlink_io.jit import numeric
from mavlink_io.mission_items import MavCmd
from mavlink_io.records import (
    NO_FIX,
    NO_PING,
    Altimeter,
    Battery,
    DuctFeedback,
    Dvl,
    GpsFix,
    Leak,
    SensorFrame,
)

_NO_LINE = TrackLine(0j, 0j, 0.0)
_MODES = frozenset(
    mode.number for mode in (modes.MISSION, modes.DEPTH, modes.HOLD, modes.SYSID, modes.SURFACE)
)
"""Modes with steady ticks: both loops are closed, and the set-points are those of the mission."""


class DeviceRecords(NamedTuple):
    """Newest record of each device; numbers without a meaning before the first."""

    gps: GpsFix = NO_FIX
    altimeter: Altimeter = Altimeter(0, math.nan, math.nan, math.nan)
    dvl: Dvl = NO_PING
    battery: Battery = Battery(math.nan, math.nan, math.nan, math.nan)
    leak: Leak = Leak(wet=False)
    duct: DuctFeedback = DuctFeedback(0, math.nan, math.nan)


NO_RECORDS = DeviceRecords()


class SteadyState(NamedTuple):
    """What steady ticks change of ``AutopilotState``."""

    time_us: int
    estimate: VehicleEstimate
    setpoint: Setpoint
    loops: LoopMemory
    line: TrackLine
    frame: SensorFrame
    """Last sensor frame."""
    changed_us: ChangeTimes
    check_us: int
    """Time of the next slow checks."""
    thrust: float
    duct_rad: tuple[float, float]
    off_depth_us: int
    """Time of the last evidence that the depth does not follow; -1 without suspicion."""
    off_depth_checks: int
    """Number of slow checks with that evidence."""
    least_depth_m: float
    risen_us: int
    """Depth and time of the last rise in mode SURFACE."""


class SensorChecks(NamedTuple):
    """What the sensor checks of one tick change of ``SteadyState``."""

    changed_us: ChangeTimes
    check_us: int
    off_depth_us: int
    off_depth_checks: int


class Task(NamedTuple):
    """What stays the same during steady ticks, and the conditions that end them."""

    heading_closed: bool
    depth_closed: bool
    """Whether the loops are closed."""
    until_us: int
    """First time that needs a full tick."""
    wanted_depth_m: float
    """Depth that the mission item in progress waits for; NaN for none."""
    following: bool
    """Whether the heading follows ``SteadyState.line``."""
    acceptance_m: float
    """Distance from its end at which the line is done."""
    ascent: AscentTask
    """Part of mode SURFACE that goes on."""
    testing: bool
    rudder_tested: bool
    test_started_us: int
    test_heading_rad: float
    confirm_us: int
    """First time at which the suspicion that the depth does not follow may be confirmed."""
    field_gauss: FieldReference
    """Magnetic field at arming."""
    home: Home


NO_TASK = Task(
    heading_closed=False,
    depth_closed=False,
    until_us=0,
    wanted_depth_m=math.nan,
    following=False,
    acceptance_m=0.0,
    ascent=NO_ASCENT,
    testing=False,
    rudder_tested=False,
    test_started_us=0,
    test_heading_rad=0.0,
    confirm_us=0,
    field_gauss=NO_FIELD,
    home=Home(),
)
"""Task without a steady tick."""


def task_of(state: AutopilotState, config: Config) -> Task | None:
    """Return the task of the next ticks of a mission.

    Parameters
    ----------
    state : AutopilotState
        State after a tick.
    config : Config
        Parameters.

    Returns
    -------
    Task | None
        Task; None if the next tick has to be a full one.
    """
    if not (
        state.armed
        and state.mode in _MODES
        and not (state.failsafe or any(state.targets) or isinstance(state.path, Circle))
        and not state.fence.zones
        and state.ahrs.per_group is None
        and not state.weight_released
        and not (config.lqg_enabled and config.lqg_controllers)
    ):
        return None
    health, test = state.health, state.test
    suspicion = _depth_suspicion(health)
    until_us = monitor.NEVER_US if suspicion else monitor.settled_until_us(health, config)
    axis = excitation.AXES[test.axis] if test else excitation.NO_AXIS
    if test:
        until_us = min(until_us, test.started_us + int(test.duration_s * US_PER_S))
    elif state.mode == modes.SYSID.number:
        return None
    if (limits := _item_limits(state, config)) is None:
        return None
    until_us = min(until_us, limits.until_us)
    if config.fs_time_s > 0.0:
        until_us = min(until_us, state.armed_us + int(config.fs_time_s * US_PER_S))
    if until_us <= state.time_us:
        return None
    return Task(
        heading_closed=not axis.opens_heading,
        depth_closed=not (axis.opens_depth or limits.ascent.waiting),
        until_us=until_us,
        wanted_depth_m=limits.wanted_depth_m,
        following=state.path is not None,
        acceptance_m=limits.acceptance_m,
        ascent=limits.ascent,
        testing=test is not None,
        rudder_tested=axis.rudder,
        test_started_us=test.started_us if test else 0,
        test_heading_rad=test.heading_rad if test else 0.0,
        confirm_us=monitor.confirm_us(suspicion, config) if suspicion else 0,
        field_gauss=health.field_gauss,
        home=state.home,
    )


class _ItemLimits(NamedTuple):
    """What ends the mission item or the ascent in progress; the fields are those of ``Task``."""

    until_us: int = monitor.NEVER_US
    wanted_depth_m: float = math.nan
    acceptance_m: float = 0.0
    ascent: AscentTask = NO_ASCENT


def _item_limits(state: AutopilotState, config: Config) -> _ItemLimits | None:
    """Return what ends the mission item or the ascent in progress; None before a full tick."""
    mission_state = state.mission
    if state.mode == modes.SURFACE.number:
        task = steady_ascent.task_of(state, config)
        return None if task is None else _ItemLimits(until_us=task.until_us, ascent=task)
    if state.mode != modes.MISSION.number:
        return _ItemLimits()
    if mission_state.current >= len(mission_state.items) or mission_state.entered_us is None:
        return None
    item = mission_state.items[mission_state.current]
    match item.command:
        case MavCmd.NAV_DELAY:
            return _ItemLimits(until_us=mission_state.entered_us + int(item.p1 * US_PER_S))
        case MavCmd.CONDITION_CHANGE_ALT:
            return _ItemLimits(wanted_depth_m=mission.new_depth_m(item))
        case MavCmd.USER_1 if state.test:
            return _ItemLimits()
        case MavCmd.NAV_WAYPOINT if isinstance(state.path, TrackLine):
            return _ItemLimits(acceptance_m=mission.acceptance_m(item, config))
    return None


def _depth_suspicion(health: Health) -> FaultTracker | None:
    """Return the suspicion that the depth does not follow; None if there is another one, or none.

    Each slow check of a change of depth may renew it, until the vehicle moves.
    """
    if len(health.faults) != 1:
        return None
    tracker = health.faults[0]
    return None if tracker.reported or tracker.fault != monitor.OFF_DEPTH else tracker


def begin(state: AutopilotState) -> SteadyState:
    """Return the part of a state that steady ticks change.

    Parameters
    ----------
    state : AutopilotState
        State after a tick.

    Returns
    -------
    SteadyState
        State for ``tick``.
    """
    suspicion = _depth_suspicion(state.health)
    return SteadyState(
        time_us=state.time_us,
        estimate=state.estimate,
        setpoint=Setpoint(*map(float, state.setpoint)),  # compiled for floats only
        loops=state.loops,
        line=state.path if isinstance(state.path, TrackLine) else _NO_LINE,
        frame=state.ahrs.frame,
        changed_us=state.ahrs.changed_us,
        check_us=state.health.check_us,
        thrust=state.thrust,
        duct_rad=state.duct_rad,
        off_depth_us=suspicion.last_us if suspicion else -1,
        off_depth_checks=suspicion.detections if suspicion else 0,
        least_depth_m=float(state.ascent.depth_m) if state.ascent else 0.0,
        risen_us=state.ascent.risen_us if state.ascent else 0,
    )


def begin_devices(devices: Devices) -> Devices:
    """Return the history of the devices with a record of numbers for each.

    Parameters
    ----------
    devices : Devices
        History in an ``AutopilotState``: without a record before the first plausible one.

    Returns
    -------
    Devices
        History for ``tick_with_devices``.
    """
    *histories, gps_under_water = devices
    filled = (
        device if sensor_checks.has_record(device) else device._replace(record=record)
        for device, record in zip(histories, NO_RECORDS, strict=True)
    )
    return Devices._make((*filled, gps_under_water))


def _end_devices(devices: Devices) -> Devices:
    """Return the history without records before the first plausible one."""
    *histories, gps_under_water = devices
    seen = [
        device if device.accepted_us >= 0 else device._replace(record=None) for device in histories
    ]
    return Devices._make((*seen, gps_under_water))


def end(
    state: AutopilotState, steady: SteadyState, devices: Devices | None = None
) -> AutopilotState:
    """Return the state after steady ticks.

    Parameters
    ----------
    state : AutopilotState
        State at which they began.
    steady : SteadyState
        State after the last of them.
    devices : Devices, optional
        History of the devices after ``tick_with_devices``.

    Returns
    -------
    AutopilotState
        State for ``core.tick``.
    """
    health = state.health._replace(
        check_us=steady.check_us,
        devices=state.health.devices if devices is None else _end_devices(devices),
    )
    suspicion = _depth_suspicion(health)
    if suspicion and steady.off_depth_us > suspicion.last_us:
        renewed = suspicion._replace(
            last_us=steady.off_depth_us,
            detections=steady.off_depth_checks,
            latest=suspicion.fault.what,
        )
        health = health._replace(faults=(renewed,))
    progress = state.ascent
    if progress is not None:
        progress = progress._replace(depth_m=steady.least_depth_m, risen_us=steady.risen_us)
    return state._replace(
        ascent=progress,
        time_us=steady.time_us,
        estimate=steady.estimate,
        setpoint=steady.setpoint,
        loops=steady.loops,
        path=state.path if state.path is None else steady.line,
        ahrs=Ahrs(steady.frame, steady.changed_us, None),
        health=health,
        thrust=steady.thrust,
        duct_rad=steady.duct_rad,
    )


@numeric
def tick(
    state: SteadyState, frame: SensorFrame, signal: ExcitationOutput, task: Task, config: Config
) -> tuple[bool, SteadyState, Trace]:
    """Advance by one tick, as ``core.tick`` does.

    Parameters
    ----------
    state : SteadyState
        State after the last tick.
    frame : SensorFrame
        Sensor frame of this tick, as received.
    signal : ExcitationOutput
        Test signal of this tick.
    task : Task
        From ``task_of`` at the beginning of the steady ticks.
    config : Config
        Parameters from ``params.flat``.

    Returns
    -------
    tuple[bool, SteadyState, Trace]
        Whether this tick is a steady one, and the state and the signals after it. If it is not, the
        others have no meaning.
    """
    dt_s = core.span_s(state.time_us, frame.time_us)
    steady, checks = check_frame(state, frame, task, config)
    estimate, _ = estimator.predict(state.estimate, frame, state.thrust, config, dt_s, False)
    return control(steady, state, checks, estimate, frame, signal, task, config, dt_s)


@numeric
def tick_with_devices(
    state: SteadyState,
    devices: Devices,
    records: DeviceRecords,
    new: int,
    frame: SensorFrame,
    signal: ExcitationOutput,
    task: Task,
    config: Config,
) -> tuple[bool, SteadyState, Devices, Trace]:
    """Advance by one tick with the records of devices beside the sensor frame.

    Parameters
    ----------
    state : SteadyState
        State after the last tick.
    devices : Devices
        History of the devices, from ``begin_devices``.
    records : DeviceRecords
        Newest records.
    new : int
        Bits of those that have come in this tick: GPS_NEW and so on.
    frame, signal, task, config
        As of ``tick``.

    Returns
    -------
    tuple[bool, SteadyState, Devices, Trace]
        As of ``tick``, with the new history of the devices.
    """
    now_us, dt_s = frame.time_us, core.span_s(state.time_us, frame.time_us)
    steady, checks = check_frame(state, frame, task, config)
    if new != 0:
        plausible, devices = add_records(devices, records, new, now_us)
        has_fix = new & GPS_NEW != 0 and sensor_checks.has_fix(records.gps)
        steady = steady and plausible and (task.home.known or not has_fix)
    steady = steady and steady_ascent.receives_as_before(
        task.ascent, devices.gps, new & GPS_NEW != 0, now_us
    )
    if now_us >= state.check_us:
        faulty = monitor.check_devices(devices, state.estimate, state.duct_rad, now_us, config)
        if (
            True in faulty
            or monitor.course_disagrees(devices, state.estimate, now_us)
            or monitor.doppler_disagrees(devices, state.estimate, now_us)
            or monitor.depth_lags(devices, state.estimate, now_us)
        ):
            steady = False
        if monitor.fix_while_submerged(devices, state.estimate, now_us):
            devices = devices._replace(gps_under_water=True)
    located = new & (GPS_NEW | DVL_NEW) != 0
    estimate, motion = estimator.predict(state.estimate, frame, state.thrust, config, dt_s, located)
    if located:
        fix = records.gps if new & GPS_NEW != 0 else NO_FIX
        estimate = estimator.use_position(
            estimate, motion, fix, new & DVL_NEW != 0, records.dvl, task.home, config
        )
    if new & ALTIMETER_NEW != 0:
        estimate = estimator.use_range(estimate, motion, records.altimeter)
    steady, advanced, trace = control(
        steady, state, checks, estimate, frame, signal, task, config, dt_s
    )
    return steady, advanced, devices, trace


@numeric
def add_records(
    devices: Devices, records: DeviceRecords, new: int, now_us: int
) -> tuple[bool, Devices]:
    """Add the new records to the history; return whether all are plausible, and the history."""
    gps, altimeter, dvl = devices.gps, devices.altimeter, devices.dvl
    battery, leak, duct = devices.battery, devices.leak, devices.duct
    fix_ok = range_ok = velocity_ok = battery_ok = True
    if new & GPS_NEW != 0:
        fix_ok, gps = sensor_checks.add_fix(gps, records.gps, now_us)
    if new & ALTIMETER_NEW != 0:
        range_ok, altimeter = sensor_checks.add_range(altimeter, records.altimeter, now_us)
    if new & DVL_NEW != 0:
        velocity_ok, dvl = sensor_checks.add_velocity(dvl, records.dvl, now_us)
    if new & BATTERY_NEW != 0:
        battery_ok, battery = sensor_checks.add_battery(battery, records.battery, now_us)
    if new & LEAK_NEW != 0:
        _, leak = sensor_checks.add_any(leak, records.leak, now_us)
    if new & DUCT_NEW != 0:
        _, duct = sensor_checks.add_any(duct, records.duct, now_us)
    plausible = fix_ok and range_ok and velocity_ok and battery_ok
    return plausible, Devices(gps, altimeter, dvl, battery, leak, duct, devices.gps_under_water)


@numeric
def check_frame(
    state: SteadyState, frame: SensorFrame, task: Task, config: Config
) -> tuple[bool, SensorChecks]:
    """Check the sensor frame, and slowly whether the depth follows.

    Returns whether nothing was found, and the new history.
    """
    now_us, check_us = frame.time_us, state.check_us
    steady, changed_us = imu_checks.check_complete_frame(
        state.frame, state.changed_us, frame, config
    )
    off_depth_us, off_depth_checks = state.off_depth_us, state.off_depth_checks
    if now_us >= check_us:
        check_us = now_us + monitor.CHECK_US
        if monitor.off_depth(state.estimate, state.setpoint, state.thrust, config):
            steady = steady and off_depth_us >= 0
            off_depth_us, off_depth_checks = now_us, off_depth_checks + 1
        sinks = monitor.dives(state.estimate, state.duct_rad, state.thrust, config)
        turns = monitor.turns_away(state.estimate, state.duct_rad, state.thrust, config)
        steady = steady and not (turns or (sinks and not task.testing))
        steady = steady and not monitor.sinks_nose_up(state.estimate, state.thrust, config)
        steady = steady and cross_checks.agree(
            state.estimate, state.frame, task.field_gauss, config
        )
    if off_depth_us >= 0:
        settled = now_us < task.confirm_us or off_depth_checks < monitor.OFF_DEPTH_CHECKS
        steady = steady and settled and now_us - off_depth_us <= monitor.FAULT_CLEAR_US
    return steady, SensorChecks(changed_us, check_us, off_depth_us, off_depth_checks)


@numeric
def control(
    steady: bool,
    state: SteadyState,
    checks: SensorChecks,
    estimate: VehicleEstimate,
    frame: SensorFrame,
    signal: ExcitationOutput,
    task: Task,
    config: Config,
    dt_s: float,
) -> tuple[bool, SteadyState, Trace]:
    """Complete a tick after its estimate: limits, guidance, loops and commands; see ``tick``."""
    now_us, setpoint, line = frame.time_us, state.setpoint, state.line
    steady = steady and failsafe.within_limits(estimate, config) and now_us < task.until_us
    if task.testing:
        elapsed_s = (now_us - task.test_started_us) / US_PER_S
        steady = steady and failsafe.within_envelope(
            task.test_heading_rad, elapsed_s, estimate, config
        )
    if abs(estimate.depth_m - task.wanted_depth_m) < mission.DEPTH_REACHED_M:
        steady = False
    if task.following:
        steady = steady and not guidance.reached(line, estimate, task.acceptance_m)
        line, heading_rad = guidance.follow_line(line, estimate, config, dt_s)
        setpoint = setpoint._replace(heading_rad=heading_rad)
    least_m, risen_us = state.least_depth_m, state.risen_us
    if task.ascent.rising or task.ascent.waiting:
        unchanged, least_m, risen_us = steady_ascent.goes_on(
            task.ascent, estimate, least_m, risen_us, now_us, config
        )
        steady = steady and unchanged
    output, memory = loops.step_pids(
        estimate, setpoint, state.loops, config, dt_s, task.heading_closed, task.depth_closed
    )
    trace = core.commands(output, setpoint.thrust, signal, task.testing, task.rudder_tested, config)
    duct_rad = monitor.predict_duct(state.duct_rad, trace.rudder_rad, trace.elevator_rad, dt_s)
    advanced = SteadyState(
        now_us,
        estimate,
        setpoint,
        memory,
        line,
        frame,
        checks.changed_us,
        checks.check_us,
        trace.thrust,
        duct_rad,
        checks.off_depth_us,
        checks.off_depth_checks,
        least_m,
        risen_us,
    )
    return steady, advanced, trace
