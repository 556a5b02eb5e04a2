"""One axis of the tailcone as identified, carried from tick to tick: ``greybox.duct_angles`` for a loop to close."""

import math

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.kernel import kernel
from sysid.greybox import Actuator

Array = NDArray[np.float64]

ANGLE, RATE, DUCT, QUEUE = range(4)
"""Of an axis: the motor's angle and rate, the duct's angle behind its play, the commands on their way, newest first."""


def at_rest(actuator: Actuator, substep_s: float) -> Array:
    """The axis at neutral, with room for the commands that its delay holds back."""
    return np.zeros(QUEUE + int(actuator.delay_s / substep_s) + 2)


@kernel
def follow(actuator: Actuator, axis: Array, command_rad: float, substep_s: float, duct_rad: Array) -> None:
    """Carry ``axis`` through the substeps that ``duct_rad`` has room for; each receives its mean true angle."""
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    damped = wn * math.sqrt(1.0 - zeta * zeta)
    decay = math.exp(-zeta * wn * substep_s)
    c, s = decay * math.cos(damped * substep_s), decay * math.sin(damped * substep_s) / damped
    late = actuator.delay_s / substep_s
    whole = int(late)
    reach, slack = actuator.rate_radps * substep_s, 0.5 * actuator.backlash_rad
    for k in range(duct_rad.size):
        for i in range(axis.size - 1, QUEUE, -1):
            axis[i] = axis[i - 1]
        axis[QUEUE] = min(max(command_rad, -actuator.travel_rad), actuator.travel_rad)
        newer, older = axis[QUEUE + whole], axis[QUEUE + whole + 1]
        target = newer + (late - whole) * (older - newer)
        error, rate, before = axis[ANGLE] - target, axis[RATE], axis[DUCT]
        free = target + (c + zeta * wn * s) * error + s * rate
        rate = -wn * wn * s * error + (c - zeta * wn * s) * rate
        angle = axis[ANGLE] + min(max(free - axis[ANGLE], -reach), reach)
        axis[RATE] = min(max(rate, -actuator.rate_radps), actuator.rate_radps)
        axis[ANGLE] = min(max(angle, -actuator.travel_rad), actuator.travel_rad)
        if axis[ANGLE] != angle:
            axis[RATE] = 0.0
        axis[DUCT] = min(max(before, axis[ANGLE] - slack), axis[ANGLE] + slack)
        duct_rad[k] = 0.5 * (before + axis[DUCT]) + actuator.bias_rad
