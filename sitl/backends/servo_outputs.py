"""Assignment of another autopilot's numbered outputs to rudder, elevator and thrust."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from mavlink_io.errors import ErrorCode, InputError

MAX_OUTPUTS = 16
"""Highest output number."""
DEFAULT = "1,2,3"
"""Outputs of rudder, elevator and thrust in the order of ``ActuatorFrame.controls``."""


class OutputsError(InputError):
    """The assignment is not valid; the message describes a valid one."""

    code = ErrorCode.SERVO_OUTPUTS


class Output(NamedTuple):
    """One output channel."""

    channel: int
    """Number from 0; the command line counts from 1."""
    sign: float
    """-1 if the output is reversed, else 1."""


class ServoOutputs(NamedTuple):
    """Output channels of the three controls."""

    rudder: Output
    """Positive turns the vehicle to starboard."""
    elevator: Output
    """Positive pitches the vehicle up."""
    thrust: Output
    """Positive accelerates the vehicle forwards."""


def parse(text: str) -> ServoOutputs:
    """Parse output numbers of rudder, elevator and thrust, as in ``1,2,3`` or ``-4,2,3``.

    Parameters
    ----------
    text : str
        Three different numbers from 1 to 16; a minus sign reverses the output.

    Raises
    ------
    OutputsError
        The text is not of this form.
    """
    words = [word.strip() for word in text.split(",")]
    numbers = [word.removeprefix("-") for word in words]
    known = {str(number) for number in range(1, MAX_OUTPUTS + 1)}
    if (
        len(numbers) != len(ServoOutputs._fields)
        or len(set(numbers)) != len(numbers)
        or not known.issuperset(numbers)
    ):
        raise OutputsError(
            f"--outputs {text}: expected the outputs of rudder, elevator and thrust, three"
            f" different numbers from 1 to {MAX_OUTPUTS} such as {DEFAULT}, with a minus sign"
            " before a reversed output"
        )
    signs = [-1.0 if word.startswith("-") else 1.0 for word in words]
    return ServoOutputs(
        *(Output(int(number) - 1, sign) for number, sign in zip(numbers, signs, strict=True))
    )


def controls_from_outputs(
    outputs: ServoOutputs, values: Sequence[float]
) -> tuple[float, float, float]:
    """Return rudder, elevator and thrust from an autopilot's output ``values``, all in [-1, 1]."""
    rudder, elevator, thrust = (sign * values[channel] for channel, sign in outputs)
    return rudder, elevator, thrust
