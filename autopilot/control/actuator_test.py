"""Moving the actuators of a disarmed vehicle one by one, as somebody does who looks at them from
the quay. Pure."""

from autopilot.control.types import US_PER_S, ActuatorTest, AutopilotState

CHANNELS = 3
_AT_REST = (0.0,) * CHANNELS


def begin(state: AutopilotState, channel: int, value: float, seconds: float) -> AutopilotState:
    """Move one actuator, for so long; what was asked of it before is forgotten."""
    others = tuple(test for test in state.actuator_tests if test.channel != channel)
    if seconds <= 0.0:
        return state._replace(actuator_tests=others)
    until_us = state.time_us + round(seconds * US_PER_S)
    return state._replace(actuator_tests=(*others, ActuatorTest(channel, value, until_us)))


def positions(state: AutopilotState) -> tuple[float, ...]:
    """Rudder, elevator and thrust in [-1, 1]: all zero where nothing is tested."""
    if not state.actuator_tests:
        return _AT_REST
    wanted = {
        test.channel: test.value for test in state.actuator_tests if state.time_us < test.until_us
    }
    return tuple(wanted.get(channel, 0.0) for channel in range(CHANNELS))
