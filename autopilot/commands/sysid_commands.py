"""Commands that begin or end an excitation for identification: long jobs."""

import math

from autopilot.commands.types import (
    CommandResult,
    Desk,
    Handler,
    Job,
    JobProgress,
    MavCommand,
    integer_parameter,
)
from autopilot.comms.stream_rates import Schedule
from autopilot.control import excitation, requests
from autopilot.control.types import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    FAILED,
    IN_PROGRESS,
    US_PER_S,
    Excitation,
)
from autopilot.vehicle import Vehicle
from mavlink_io.mission_items import MavCmd

_PITCH, _YAW = 2, 4
"""AUTOTUNE_AXIS of common.xml, which pymavlink lacks."""
_AXES = {
    0: excitation.ELEVATOR_AXIS,
    _PITCH: excitation.ELEVATOR_AXIS,
    _YAW: excitation.RUDDER_AXIS,
}
"""By DO_AUTOTUNE_ENABLE.param2: one at a time, 0 leaves the choice to the vehicle."""


def test(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """MAV_CMD_USER_1: axis, size, two numbers of the wave's own, duration, wave, fade; axis 0
    stops."""
    axis = integer_parameter(command.p1)
    if axis == 0:
        return desk.ask(requests.StopTest())
    p3, p4, duration_s, fade_s = (
        float(value) if math.isfinite(value) else 0.0
        for value in (command.p3, command.p4, command.p5, command.p7)
    )
    return begin(
        desk,
        excitation.from_numbers(
            axis, command.p2, p3, p4, duration_s, integer_parameter(command.p6), fade_s
        ),
    )


def autotune(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """Plays the test that the SID_* parameters describe: gains are designed ashore, from the log of
    it."""
    if command.p1 == 0:
        return desk.ask(requests.StopTest())
    axis = _AXES.get(integer_parameter(command.p2))
    if command.p1 != 1 or axis is None:
        known = ", ".join(map(str, _AXES))
        return desk.refuse(
            DENIED, f"DO_AUTOTUNE_ENABLE: param1 must be 0 or 1, param2 one of {known}"
        )
    return begin(desk, excitation.from_config(desk.vehicle.params.config)._replace(axis=axis))


def begin(desk: Desk, wish: requests.StartTest) -> CommandResult:
    outcome = desk.ask(wish)
    started = desk.vehicle.state.test
    if outcome.result != ACCEPTED or started is None:
        return outcome
    return CommandResult(IN_PROGRESS, job=job(desk.vehicle, started))


def job(vehicle: Vehicle, started: Excitation) -> Job:
    """Done when the test has run its time; cancelled or failed where it was stopped before."""

    def look() -> JobProgress:
        state = vehicle.state
        share = (state.time_us - started.started_us) / US_PER_S / started.duration_s
        if state.test == started:
            return JobProgress(IN_PROGRESS, max(0, min(99, int(100.0 * share))))
        if share >= 1.0:
            return JobProgress(ACCEPTED)
        return JobProgress(FAILED if state.failsafe else CANCELLED)

    return look


HANDLERS: dict[MavCmd, Handler] = {MavCmd.USER_1: test, MavCmd.DO_AUTOTUNE_ENABLE: autotune}
