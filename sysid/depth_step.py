"""A depth change as the autopilot flies it: limits and anti-windup included, on the linear pitch plane.

The linear step response overstates the overshoot of an integrator that in the water stands still while pitch is
limited, and that never holds more than DPT_IMAX.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sitl.vehicle.kernel import kernel
from sysid.loops import Gains, Lag, chain, lead_of
from sysid.planes import LinearPlane

Array = NDArray[np.float64]

STEP_M = 3.0
"""The paper's depth change in its combined mission."""
PITCH_LIMIT_RAD = math.radians(20.0)
TRAVEL_RAD = math.radians(15.0)
SECONDS = 45.0
DT_S = 0.05


class Answer(NamedTuple):
    """To a step in depth, as shares of it; the larger of down and up."""

    overshoot: float
    """By how much the vehicle passes its new depth."""
    left: float
    """How far from it she is after 45 s."""


def answer(plane: LinearPlane, lag: Lag, gains: Gains, level_pitch_rad: float) -> Answer:
    """What a vehicle that flew level at ``level_pitch_rad`` makes of a step."""
    A, B = chain(plane, lag, 4, lead_of(gains))
    n = A.shape[0]
    block = expm(np.block([[A, B[:, None]], [np.zeros((1, n + 1))]]) * DT_S)
    law = np.array([gains[name] for name in ("PTCH_P", "PTCH_D", "DPT_P", "DPT_D", "DPT_I", "DPT_IMAX")])
    Phi, Gamma, rate_row = np.ascontiguousarray(block[:n, :n]), block[:n, n].copy(), plane.A[3].copy()
    ways = [_fly(Phi, Gamma, rate_row, law, way * STEP_M, level_pitch_rad, int(SECONDS / DT_S)) for way in (1.0, -1.0)]
    return Answer(*(max(shares) for shares in zip(*ways, strict=True)))


@kernel
def _fly(
    Phi: Array, Gamma: Array, rate_row: Array, law: Array, step_m: float, level_rad: float, ticks: int
) -> tuple[float, float]:
    """(largest overshoot, last distance) over |step|.

    States are departures from level flight, which the integrator already carries.
    """
    n = Gamma.size
    x, moved = np.zeros(n), np.empty(n)
    pitch_p, pitch_d, depth_p, depth_d, depth_i, limit = law
    integral = min(max(-level_rad, -limit), limit)
    worst = 0.0
    for _ in range(ticks):
        error = step_m - x[3]
        rate = 0.0
        for i in range(rate_row.size):
            rate += rate_row[i] * x[i]
        down = depth_p * error - depth_d * rate + integral
        held = min(max(down, -PITCH_LIMIT_RAD), PITCH_LIMIT_RAD)
        if held == down or (down - held) * error < 0.0:
            integral = min(max(integral + depth_i * error * DT_S, -limit), limit)
        elevator = pitch_p * (-held - level_rad - x[2]) - pitch_d * x[1]
        elevator = min(max(elevator, -TRAVEL_RAD), TRAVEL_RAD)
        for i in range(n):
            moved[i] = Gamma[i] * elevator
            for j in range(n):
                moved[i] += Phi[i, j] * x[j]
        for i in range(n):
            x[i] = moved[i]
        worst = max(worst, (x[3] - step_m) / step_m)
    return worst, abs(x[3] / step_m - 1.0)
