"""Test of single actuators of a disarmed vehicle. Pure."""

from autopilot.control.types import US_PER_S, ActuatorTest, AutopilotState

CHANNELS = 3
"""Number of actuator channels: rudder, elevator, thrust."""
_AT_REST = (0.0,) * CHANNELS


def begin(state: AutopilotState, channel: int, value: float, seconds: float) -> AutopilotState:
    """Start a test of one actuator, which replaces an earlier test of the same actuator.

    Parameters
    ----------
    state : AutopilotState
        State of a disarmed vehicle.
    channel : int
        0 rudder, 1 elevator, 2 thrust.
    value : float
        Command in [-1, 1].
    seconds : float
        Duration in vehicle time; 0 ends the test at once.
    """
    others = tuple(test for test in state.actuator_tests if test.channel != channel)
    if seconds <= 0.0:
        return state._replace(actuator_tests=others)
    until_us = state.time_us + round(seconds * US_PER_S)
    return state._replace(actuator_tests=(*others, ActuatorTest(channel, value, until_us)))


def positions(state: AutopilotState) -> tuple[float, ...]:
    """Return the commands of rudder, elevator and thrust in [-1, 1]; 0 if not tested."""
    if not state.actuator_tests:
        return _AT_REST
    commands = {
        test.channel: test.value for test in state.actuator_tests if state.time_us < test.until_us
    }
    return tuple(commands.get(channel, 0.0) for channel in range(CHANNELS))
