"""Delay and loop gain implied by each printed pole: the root-locus conditions (Evans 1948).

A closed loop has the pole s where k L(s) exp(-s T) = -1. The angle condition gives the delay T, the
magnitude condition the loop gain k. Other rows, approximations of the delay and the choice of a
dominant pole do not enter.
"""

import cmath
import math
from typing import NamedTuple

import numpy as np

from sysid.control_analysis.loop_transfer import Gains, Lag
from sysid.control_analysis.margins import Planes
from sysid.models.parameters import PARAMETERS
from sysid.reproduction.paper_poles.poles import (
    CONTROLLERS,
    LAG,
    close_loop,
    models,
    open_loop,
)
from sysid.reproduction.paper_tables import TABLE_4

BENCH_SD = {
    p.name: p.prior_sd for p in PARAMETERS if p.name in ("natural_frequency", "damping_ratio")
}
"""Relative standard deviation of the tailcone's lag after a bench test."""


class SinglePoleCondition(NamedTuple):
    """Delay and gain of one row."""

    loop: str
    case: str
    delay_s: float
    delay_sd_s: float
    """Standard deviation of the delay due to the lag's natural frequency and damping (s)."""
    loop_gain: float
    """Loop gain relative to that of Tables 1 and 3."""


def single_pole_conditions() -> list[SinglePoleCondition]:
    """Return delay and loop gain that each of the nine rows implies.

    Returns
    -------
    list of SinglePoleCondition
        One condition per row, with the lag of the tailcone but not its delay.
    """
    planes = models()
    return [
        _row(loop, case, pole, planes[case[0]], CONTROLLERS[case[2]])
        for (loop, case), pole in TABLE_4.items()
    ]


def required_delay_and_gain(
    loop: str, planes: Planes, gains: Gains, pole: complex, lag: Lag
) -> tuple[float, float]:
    """Return the delay (s) and the loop gain with which a loop has this pole."""
    opened = open_loop(loop, close_loop(loop, planes, lag._replace(delay_s=0.0), gains))
    at_pole = complex(
        -opened.output_vector
        @ np.linalg.solve(pole * np.eye(len(opened.A)) - opened.A, opened.input_vector)
    )
    delay_s = cmath.phase(-at_pole) / pole.imag
    return delay_s, 1.0 / abs(at_pole * cmath.exp(-pole * delay_s))


def _row(loop: str, case: str, pole: complex, planes: Planes, gains: Gains) -> SinglePoleCondition:
    """Return the condition of one row."""
    delay_s, gain = required_delay_and_gain(loop, planes, gains, pole, LAG)
    faster_lag = LAG._replace(
        natural_frequency_radps=LAG.natural_frequency_radps * (1.0 + BENCH_SD["natural_frequency"])
    )
    damped_lag = LAG._replace(damping_ratio=LAG.damping_ratio * (1.0 + BENCH_SD["damping_ratio"]))
    delay_changes_s = [
        required_delay_and_gain(loop, planes, gains, pole, changed_lag)[0] - delay_s
        for changed_lag in (faster_lag, damped_lag)
    ]
    return SinglePoleCondition(
        loop=loop,
        case=case,
        delay_s=delay_s,
        delay_sd_s=math.hypot(*delay_changes_s),
        loop_gain=gain,
    )
