"""Which of another autopilot's numbered outputs turns the duct and which drives the propeller."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

MAX_OUTPUTS = 16
DEFAULT = "1,2,3"
"""In the order of our own autopilot's controls."""


class OutputsError(ValueError):
    """No such assignment; the message says what would be right."""


class Output(NamedTuple):
    place: int
    """Counted from 0, where people count from 1."""
    sign: float
    """-1 where the autopilot means it the other way round."""


class ServoOutputs(NamedTuple):
    rudder: Output
    """Positive turns her to starboard."""
    elevator: Output
    """Positive lifts her nose."""
    thrust: Output
    """Positive drives her forward."""


def parse(text: str) -> ServoOutputs:
    """The outputs of rudder, elevator and thrust, counted from 1, as in ``1,2,3``; a minus turns
    one round: ``-4,2,3``.

    Raises OutputsError: these are not three different outputs.
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
            f" different numbers from 1 to {MAX_OUTPUTS} such as {DEFAULT}, with a minus before"
            " one that is to be turned round"
        )
    signs = [-1.0 if word.startswith("-") else 1.0 for word in words]
    return ServoOutputs(
        *(Output(int(number) - 1, sign) for number, sign in zip(numbers, signs, strict=True))
    )


def controls_from_outputs(
    outputs: ServoOutputs, values: Sequence[float]
) -> tuple[float, float, float]:
    """Rudder, elevator and thrust as ``ActuatorFrame.controls`` has them, of an autopilot's
    ``values`` in [-1, 1]."""
    rudder, elevator, thrust = (sign * values[place] for place, sign in outputs)
    return rudder, elevator, thrust
