"""Output numbers of rudder, elevator and thrust, and the scale of the outputs.

Syntax and scale are those of ``sitl --outputs`` (docs/other_autopilots.md).
"""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Array, LogError

PULSE_CENTRE_US = 1500.0
"""Servo pulse at zero deflection."""
PULSE_HALF_US = 400.0
"""Difference of the servo pulse at full travel from the centre."""
MAX_FRACTION = 2.0
"""Output above which the values are servo pulses in microseconds, not fractions of the travel."""


class ServoChannels(NamedTuple):
    """Output numbers, counted from 1; negative for an output with reversed sign."""

    rudder: int
    elevator: int
    thrust: int


FIRST_THREE = ServoChannels(1, 2, 3)
"""Default outputs."""


def parse(text: str) -> ServoChannels:
    """Parse ``RUDDER,ELEVATOR,THRUST``, for example ``1,-2,3``.

    Parameters
    ----------
    text : str
        Three output numbers, counted from 1, with a minus for a reversed output.

    Returns
    -------
    ServoChannels
        The output numbers.

    Raises
    ------
    LogError
        The text has another form.
    """
    if not re.fullmatch(r"-?[1-9]\d?(,-?[1-9]\d?){2}", text):
        raise LogError(
            f"--servo-channels {text}: give RUDDER,ELEVATOR,THRUST counted from 1, "
            "with a minus for a reversed output"
        )
    return ServoChannels(*(int(part) for part in text.split(",")))


def surface_commands(
    values: NDArray[np.float64], outputs: ServoChannels, where: str
) -> tuple[Array, Array, Array]:
    """Return rudder, elevator and thrust as fractions -1..1.

    Parameters
    ----------
    values : ndarray, shape (n, outputs)
        Fractions of the travel, or pulses in microseconds: 1500 us is zero, 400 us full travel. A
        pulse of 0 us and NaN are zero deflection.
    outputs : ServoChannels
        Output numbers of rudder, elevator and thrust.
    where : str
        File and message, for the error.

    Returns
    -------
    tuple of three ndarray, shape (n,)
        Rudder, elevator and thrust.

    Raises
    ------
    LogError
        The log does not have one of the outputs.
    """
    largest = max(abs(number) for number in outputs)
    if largest > values.shape[1]:
        raise LogError(
            f"{where} has {values.shape[1]} outputs but not number {largest}; give other numbers"
            " with --servo-channels"
        )
    chosen = values[:, [abs(number) - 1 for number in outputs]]
    if np.nanmax(np.abs(chosen), initial=0.0) > MAX_FRACTION:
        pulses = np.where(chosen == 0.0, PULSE_CENTRE_US, chosen)
        chosen = np.clip((pulses - PULSE_CENTRE_US) / PULSE_HALF_US, -1.0, 1.0)
    chosen = np.nan_to_num(chosen) * np.sign(outputs)
    return chosen[:, 0], chosen[:, 1], chosen[:, 2]
