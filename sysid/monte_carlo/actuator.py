"""One axis of the identified tailcone, advanced tick by tick for use in a closed loop.

The model is that of ``greybox.duct_angles``: delay, second-order lag with rate limit, travel, play
and bias.
"""

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.jit import kernel
from sysid.models import greybox
from sysid.models.greybox import Actuator

Array = NDArray[np.float64]

ANGLE, RATE, DUCT, QUEUE = range(4)
"""Indices of an axis.

Motor angle (rad) and rate (rad/s), duct angle behind the play (rad), and the queue of delayed
commands (rad), newest first.
"""


def at_rest(actuator: Actuator, substep_s: float) -> Array:
    """Return the axis at neutral, with a queue for the commands within its delay."""
    return np.zeros(QUEUE + int(actuator.delay_s / substep_s) + 2)


@kernel
def follow(
    actuator: Actuator, axis: Array, command_rad: float, substep_s: float, duct_rad: Array
) -> None:
    """Advance `axis` by the substeps of `duct_rad`; each element receives its mean duct angle.

    Lag: a'' = wn^2 (u(t - T) - a) - 2 zeta wn a', with rate limit (``greybox.step_actuator``). The
    command u is limited to the travel and delayed by linear interpolation. Play: the duct moves
    only when the motor is more than half the play away. Angles in rad.
    """
    c, s = greybox.lag_coefficients(actuator, substep_s)
    delay_steps, half_play = actuator.delay_s / substep_s, 0.5 * actuator.backlash_rad
    whole_steps = int(delay_steps)
    for k in range(duct_rad.size):
        for i in range(axis.size - 1, QUEUE, -1):
            axis[i] = axis[i - 1]
        axis[QUEUE] = min(max(command_rad, -actuator.travel_rad), actuator.travel_rad)
        newer_command, older_command = axis[QUEUE + whole_steps], axis[QUEUE + whole_steps + 1]
        target = newer_command + (delay_steps - whole_steps) * (older_command - newer_command)
        axis[ANGLE], axis[RATE] = greybox.step_actuator(
            actuator, axis[ANGLE], axis[RATE], target, c, s, substep_s
        )
        previous_duct = axis[DUCT]
        axis[DUCT] = min(max(previous_duct, axis[ANGLE] - half_play), axis[ANGLE] + half_play)
        duct_rad[k] = 0.5 * (previous_duct + axis[DUCT]) + actuator.bias_rad
