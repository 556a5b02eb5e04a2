"""Commands that move the actuators themselves: by hand under way, and one by one on the bench."""

import math

from autopilot.commands.types import CommandResult, Desk, Handler, MavCommand, integer_parameter
from autopilot.comms.stream_rates import Schedule
from autopilot.control import modes, requests
from autopilot.control.types import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
from mavlink_io.dialect import constant
from mavlink_io.mission_items import MavCmd

MAX_TEST_S = 3.0
_MOTOR, _SERVO = (
    constant("ACTUATOR_OUTPUT_FUNCTION_MOTOR1"),
    constant("ACTUATOR_OUTPUT_FUNCTION_SERVO1"),
)
_CHANNELS = {_SERVO: 0, _SERVO + 1: 1, _MOTOR: 2}
"""Rudder, elevator and propeller, in the order of the actuator messages."""


def set_actuators(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """DO_SET_ACTUATOR: rudder, elevator and thrust in -1..1 until somebody else steers; NaN leaves
    one as it is."""
    values = command.p1, command.p2, command.p3
    further = command.p4, command.p5, command.p6
    if any(math.isfinite(value) and value != 0.0 for value in further) or integer_parameter(
        command.p7
    ):
        return desk.refuse(
            DENIED, "DO_SET_ACTUATOR: there are 3 actuators: rudder, elevator, thrust"
        )
    if any(abs(value) > 1.0 for value in values):
        return desk.refuse(DENIED, "DO_SET_ACTUATOR: values must be -1 to 1")
    state = desk.vehicle.state
    if not state.armed or state.mode != modes.MANUAL.number:
        return desk.refuse(TEMPORARILY_REJECTED, "DO_SET_ACTUATOR refused: arm, and take MANUAL")
    desk.helm.fix(*values)
    return CommandResult(ACCEPTED)


def test_actuator(desk: Desk, command: MavCommand, schedule: Schedule) -> CommandResult:
    """ACTUATOR_TEST: one actuator for at most 3 s, disarmed; NaN or no time lets it go."""
    channel = _CHANNELS.get(integer_parameter(command.p5))
    if channel is None:
        known = ", ".join(map(str, _CHANNELS))
        return desk.refuse(
            UNSUPPORTED, f"ACTUATOR_TEST: param5 is {command.p5:g}, must be one of {known}"
        )
    if abs(command.p1) > 1.0:
        return desk.refuse(DENIED, f"ACTUATOR_TEST: param1 is {command.p1:g}, must be -1 to 1")
    seconds = command.p2 if math.isfinite(command.p2) and math.isfinite(command.p1) else 0.0
    value = command.p1 if math.isfinite(command.p1) else 0.0
    return desk.ask(requests.TestActuator(channel, value, min(MAX_TEST_S, max(0.0, seconds))))


HANDLERS: dict[MavCmd, Handler] = {
    MavCmd.DO_SET_ACTUATOR: set_actuators,
    MavCmd.ACTUATOR_TEST: test_actuator,
}
