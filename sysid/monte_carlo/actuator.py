"""One axis of the tailcone as identified, carried from tick to tick: ``greybox.duct_angles`` for a
loop to close."""

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.jit import kernel
from sysid.models import greybox
from sysid.models.greybox import Actuator

Array = NDArray[np.float64]

ANGLE, RATE, DUCT, QUEUE = range(4)
"""Of an axis: the motor's angle and rate, the duct's angle behind its play, the commands on their
way, newest first."""


def at_rest(actuator: Actuator, substep_s: float) -> Array:
    """The axis at neutral, with room for the commands that its delay holds back."""
    return np.zeros(QUEUE + int(actuator.delay_s / substep_s) + 2)


@kernel
def follow(
    actuator: Actuator, axis: Array, command_rad: float, substep_s: float, duct_rad: Array
) -> None:
    """Carry ``axis`` through the substeps that ``duct_rad`` has room for; each receives its mean
    true angle."""
    c, s = greybox.lag_coefficients(actuator, substep_s)
    late, slack = actuator.delay_s / substep_s, 0.5 * actuator.backlash_rad
    whole = int(late)
    for k in range(duct_rad.size):
        for i in range(axis.size - 1, QUEUE, -1):
            axis[i] = axis[i - 1]
        axis[QUEUE] = min(max(command_rad, -actuator.travel_rad), actuator.travel_rad)
        newer, older = axis[QUEUE + whole], axis[QUEUE + whole + 1]
        target = newer + (late - whole) * (older - newer)
        axis[ANGLE], axis[RATE] = greybox.step_actuator(
            actuator, axis[ANGLE], axis[RATE], target, c, s, substep_s
        )
        before = axis[DUCT]
        axis[DUCT] = min(max(before, axis[ANGLE] - slack), axis[ANGLE] + slack)
        duct_rad[k] = 0.5 * (before + axis[DUCT]) + actuator.bias_rad
