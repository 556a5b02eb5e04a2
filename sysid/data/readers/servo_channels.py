"""Which of an autopilot's outputs steer, and what an output's number means.

The same words and the same scale as ``sitl --outputs`` (docs/other_autopilots.md), so that what was
flown with those outputs is read with them."""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Array, LogError

PULSE_CENTRE_US = 1500.0
PULSE_HALF_US = 400.0
MAX_FRACTION = 2.0
"""An output beyond this is a servo's pulse in microseconds, not a fraction of its travel."""


class ServoChannels(NamedTuple):
    """Outputs counted from 1; negative: turned round."""

    rudder: int
    elevator: int
    thrust: int


FIRST_THREE = ServoChannels(1, 2, 3)


def parse(text: str) -> ServoChannels:
    """``RUDDER,ELEVATOR,THRUST``, as in ``1,-2,3``.

    Raises:
        LogError: it is anything else.
    """
    if not re.fullmatch(r"-?[1-9]\d?(,-?[1-9]\d?){2}", text):
        raise LogError(
            f"--servo-channels {text}: give RUDDER,ELEVATOR,THRUST, counted from 1, with a minus"
            " where the sign is reversed"
        )
    return ServoChannels(*(int(part) for part in text.split(",")))


def surface_commands(
    values: NDArray[np.float64], outputs: ServoChannels, where: str
) -> tuple[Array, Array, Array]:
    """Rudder, elevator and thrust as fractions -1..1 from outputs of shape (n, outputs).

    Fractions are taken as they are; of pulses, 1500 us is the middle and 400 us the travel. An
    output of 0 us or NaN asks for nothing.

    Raises:
        LogError: the log has no such output; ``where`` names file and message.
    """
    largest = max(abs(number) for number in outputs)
    if largest > values.shape[1]:
        raise LogError(
            f"{where} holds {values.shape[1]} outputs, none is number {largest}; give"
            " others with --servo-channels"
        )
    chosen = values[:, [abs(number) - 1 for number in outputs]]
    if np.nanmax(np.abs(chosen), initial=0.0) > MAX_FRACTION:
        pulses = np.where(chosen == 0.0, PULSE_CENTRE_US, chosen)
        chosen = np.clip((pulses - PULSE_CENTRE_US) / PULSE_HALF_US, -1.0, 1.0)
    chosen = np.nan_to_num(chosen) * np.sign(outputs)
    return chosen[:, 0], chosen[:, 1], chosen[:, 2]
