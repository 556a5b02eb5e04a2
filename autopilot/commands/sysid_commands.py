"""Commands that start or stop an identification test; they are long-running."""

import math

from autopilot.commands.types import (
    CommandContext,
    CommandResult,
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
"""Values of AUTOTUNE_AXIS in common.xml; pymavlink has no constants for them."""
_AXES = {
    0: excitation.ELEVATOR_AXIS,
    _PITCH: excitation.ELEVATOR_AXIS,
    _YAW: excitation.RUDDER_AXIS,
}
"""Test axis by DO_AUTOTUNE_ENABLE.param2; 0 (all axes) selects the elevator."""


def test(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """MAV_CMD_USER_1: start a test, or stop it with axis 0.

    Parameters 1 to 7: axis, magnitude, two parameters of the waveform, duration (s), waveform,
    fade (s).
    """
    axis = integer_parameter(command.p1)
    if axis == 0:
        return context.ask(requests.StopTest())
    p3, p4, duration_s, fade_s = (
        float(value) if math.isfinite(value) else 0.0
        for value in (command.p3, command.p4, command.p5, command.p7)
    )
    return begin(
        context,
        excitation.from_numbers(
            axis, command.p2, p3, p4, duration_s, integer_parameter(command.p6), fade_s
        ),
    )


def autotune(context: CommandContext, command: MavCommand, schedule: Schedule) -> CommandResult:
    """DO_AUTOTUNE_ENABLE: start or stop the test of the SID_* parameters.

    The vehicle does not change its gains; they are designed on the ground from the log.
    """
    if command.p1 == 0:
        return context.ask(requests.StopTest())
    axis = _AXES.get(integer_parameter(command.p2))
    if command.p1 != 1 or axis is None:
        known = ", ".join(map(str, _AXES))
        return context.refuse(
            DENIED, f"DO_AUTOTUNE_ENABLE: param1 must be 0 or 1, param2 one of {known}"
        )
    return begin(context, excitation.from_config(context.vehicle.params.config)._replace(axis=axis))


def begin(context: CommandContext, request: requests.StartTest) -> CommandResult:
    """Start a test; return IN_PROGRESS with its job, or the refusal."""
    outcome = context.ask(request)
    started = context.vehicle.state.test
    if outcome.result != ACCEPTED or started is None:
        return outcome
    return CommandResult(IN_PROGRESS, job=job(context.vehicle, started))


def job(vehicle: Vehicle, started: Excitation) -> Job:
    """Return the progress function of a test: accepted at its end, else cancelled or failed."""

    def read_progress() -> JobProgress:
        """Return the elapsed percentage, or the result of the ended test."""
        state = vehicle.state
        fraction = (state.time_us - started.started_us) / US_PER_S / started.duration_s
        if state.test == started:
            return JobProgress(IN_PROGRESS, max(0, min(99, int(100.0 * fraction))))
        if fraction >= 1.0:
            return JobProgress(ACCEPTED)
        return JobProgress(FAILED if state.failsafe else CANCELLED)

    return read_progress


HANDLERS: dict[MavCmd, Handler] = {MavCmd.USER_1: test, MavCmd.DO_AUTOTUNE_ENABLE: autotune}
