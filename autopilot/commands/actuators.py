"""Commands that set actuators directly: in MANUAL mode, and one by one on the bench."""

import math

from autopilot.commands.types import (
    CommandContext,
    CommandResult,
    Handler,
    MavCommand,
    integer_parameter,
)
from autopilot.comms.stream_rates import Schedule
from autopilot.control import modes, requests
from autopilot.control.types import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
from mavlink_io.dialect import constant
from mavlink_io.mission_items import MavCmd

MAX_TEST_S = 3.0
"""Longest actuator test."""
_MOTOR, _SERVO = (
    constant("ACTUATOR_OUTPUT_FUNCTION_MOTOR1"),
    constant("ACTUATOR_OUTPUT_FUNCTION_SERVO1"),
)
_CHANNELS = {_SERVO: 0, _SERVO + 1: 1, _MOTOR: 2}
"""Channel by actuator function: rudder, elevator, propeller."""


def set_actuators(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """DO_SET_ACTUATOR: set rudder, elevator and thrust (-1..1) until another input replaces them.

    NaN leaves an actuator unchanged.
    """
    values = command.p1, command.p2, command.p3
    unused = command.p4, command.p5, command.p6
    if any(math.isfinite(value) and value != 0.0 for value in unused) or integer_parameter(
        command.p7
    ):
        return context.refuse(
            DENIED, "DO_SET_ACTUATOR: there are 3 actuators: rudder, elevator, thrust"
        )
    if any(abs(value) > 1.0 for value in values):
        return context.refuse(DENIED, "DO_SET_ACTUATOR: values must be -1 to 1")
    state = context.vehicle.state
    if not state.armed or state.mode != modes.MANUAL.number:
        return context.refuse(
            TEMPORARILY_REJECTED, "DO_SET_ACTUATOR refused: arm and select MANUAL"
        )
    context.helm.fix(*values)
    return CommandResult(ACCEPTED)


def test_actuator(
    context: CommandContext, command: MavCommand, schedule: Schedule
) -> CommandResult:
    """ACTUATOR_TEST: move one actuator for at most MAX_TEST_S; NaN or 0 s stops it."""
    channel = _CHANNELS.get(integer_parameter(command.p5))
    if channel is None:
        known = ", ".join(map(str, _CHANNELS))
        return context.refuse(
            UNSUPPORTED, f"ACTUATOR_TEST: param5 is {command.p5:g}, must be one of {known}"
        )
    if abs(command.p1) > 1.0:
        return context.refuse(DENIED, f"ACTUATOR_TEST: param1 is {command.p1:g}, must be -1 to 1")
    seconds = command.p2 if math.isfinite(command.p2) and math.isfinite(command.p1) else 0.0
    value = command.p1 if math.isfinite(command.p1) else 0.0
    return context.ask(requests.TestActuator(channel, value, min(MAX_TEST_S, max(0.0, seconds))))


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.DO_SET_ACTUATOR: set_actuators,
    MavCmd.ACTUATOR_TEST: test_actuator,
}
