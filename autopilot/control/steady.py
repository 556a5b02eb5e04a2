"""The tick while only numbers change: no event, no new mission item, no fault, no device record.

``core.tick`` is the tick; this one is its numeric part, from the same functions, for compiled code
that flies many ticks in one call. It gives the same numbers, and refuses every tick in which
anything else could happen: then ``core.tick`` has to run. Used by simulations in process.
"""

import math
from typing import NamedTuple

from autopilot.control import core, estimator, excitation, failsafe, guidance, loops, mission, modes
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.params import Config
from autopilot.control.sensor_health import imu_checks, monitor
from autopilot.control.sensor_health.types import (
    Ahrs,
    ChangeTimes,
    Device,
    FaultTracker,
    Health,
)
from autopilot.control.setpoints import Setpoint, TrackLine
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    LoopMemory,
    Trace,
    VehicleEstimate,
)
from mavlink_io.jit import numeric
from mavlink_io.mission_items import MavCmd
from mavlink_io.records import SensorFrame

_NO_LINE = TrackLine(0j, 0j, 0.0)
_NO_DEVICES = (Device(),) * (len(Health._fields) - 3)


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
    testing: bool
    rudder_tested: bool
    test_started_us: int
    test_heading_rad: float
    confirm_us: int
    """First time at which the suspicion that the depth does not follow may be confirmed."""


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
    health, mission_state = state.health, state.mission
    if not (
        state.armed
        and state.mode == modes.MISSION.number
        and mission_state.current < len(mission_state.items)
        and mission_state.entered_us is not None
        and not (state.failsafe or any(state.targets))
        and health[: len(_NO_DEVICES)] == _NO_DEVICES
        and state.ahrs.per_group is None
        and not (config.lqg_enabled and config.lqg_controllers)
    ):
        return None
    item, test = mission_state.items[mission_state.current], state.test
    suspicion = _depth_suspicion(health)
    until_us = monitor.NEVER_US if suspicion else monitor.settled_until_us(health, config)
    axis = excitation.AXES[test.axis] if test else excitation.NO_AXIS
    wanted_depth_m, acceptance_m = math.nan, 0.0
    match item.command:
        case MavCmd.NAV_DELAY:
            until_us = min(until_us, mission_state.entered_us + int(item.p1 * US_PER_S))
        case MavCmd.CONDITION_CHANGE_ALT:
            wanted_depth_m = mission.new_depth_m(item)
        case MavCmd.USER_1 if test:
            until_us = min(until_us, test.started_us + int(test.duration_s * US_PER_S))
        case MavCmd.NAV_WAYPOINT if isinstance(state.path, TrackLine):
            acceptance_m = mission.acceptance_m(item, config)
        case _:
            return None
    if config.fs_time_s > 0.0:
        until_us = min(until_us, state.armed_us + int(config.fs_time_s * US_PER_S))
    if until_us <= state.time_us:
        return None
    return Task(
        heading_closed=not axis.opens_heading,
        depth_closed=not axis.opens_depth,
        until_us=until_us,
        wanted_depth_m=wanted_depth_m,
        following=state.path is not None,
        acceptance_m=acceptance_m,
        testing=test is not None,
        rudder_tested=axis.rudder,
        test_started_us=test.started_us if test else 0,
        test_heading_rad=test.heading_rad if test else 0.0,
        confirm_us=monitor.confirm_us(suspicion, config) if suspicion else 0,
    )


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
    )


def end(state: AutopilotState, steady: SteadyState) -> AutopilotState:
    """Return the state after steady ticks.

    Parameters
    ----------
    state : AutopilotState
        State at which they began.
    steady : SteadyState
        State after the last of them.

    Returns
    -------
    AutopilotState
        State for ``core.tick``.
    """
    health = state.health._replace(check_us=steady.check_us)
    suspicion = _depth_suspicion(health)
    if suspicion and steady.off_depth_us > suspicion.last_us:
        renewed = suspicion._replace(
            last_us=steady.off_depth_us,
            detections=steady.off_depth_checks,
            latest=suspicion.fault.what,
        )
        health = health._replace(faults=(renewed,))
    return state._replace(
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
    now_us, old, setpoint, line = frame.time_us, state.estimate, state.setpoint, state.line
    dt_s, check_us = core.span_s(state.time_us, now_us), state.check_us
    steady, changed_us = imu_checks.check_complete_frame(
        state.frame, state.changed_us, frame, config
    )
    off_depth_us, off_depth_checks = state.off_depth_us, state.off_depth_checks
    if now_us >= check_us:
        check_us = now_us + monitor.CHECK_US
        if monitor.off_depth(old, setpoint, state.thrust, config):
            steady = steady and off_depth_us >= 0
            off_depth_us, off_depth_checks = now_us, off_depth_checks + 1
    if off_depth_us >= 0:
        settled = now_us < task.confirm_us or off_depth_checks < monitor.OFF_DEPTH_CHECKS
        steady = steady and settled and now_us - off_depth_us <= monitor.FAULT_CLEAR_US
    estimate, _ = estimator.predict(old, frame, state.thrust, config, dt_s, False)
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
        changed_us,
        check_us,
        trace.thrust,
        duct_rad,
        off_depth_us,
        off_depth_checks,
    )
    return steady, advanced, trace
