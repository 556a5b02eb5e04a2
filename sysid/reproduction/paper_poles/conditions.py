"""What each printed pole asks for by itself: the two conditions of a root locus (Evans 1948).

A closed loop has the pole s where k L(s) e^(-sT) = -1. The angle of that alone gives the delay T,
its size then the loop gain k; any other rows, any approximation of the delay and the choice of a
dominant pole are left out of it."""

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
"""How well a bench test knows the tailcone's lag, as shares."""


class SinglePoleCondition(NamedTuple):
    loop: str
    case: str
    delay_s: float
    delay_sd_s: float
    """What the lag's natural frequency and damping leave open, one standard deviation each."""
    loop_gain: float
    """Over that of Tables 1 and 3."""


def single_pole_conditions(lag: Lag = LAG) -> list[SinglePoleCondition]:
    """Of all nine rows, behind the lag's natural frequency and damping; its own delay is
    ignored."""
    known = models()
    return [
        _row(loop, case, pole, known[case[0]], CONTROLLERS[case[2]], lag)
        for (loop, case), pole in TABLE_4.items()
    ]


def required_delay_and_gain(
    loop: str, planes: Planes, gains: Gains, pole: complex, lag: Lag
) -> tuple[float, float]:
    """(delay, loop gain) with which the loop has this pole."""
    cut = open_loop(loop, close_loop(loop, planes, lag._replace(delay_s=0.0), gains))
    at_pole = complex(-cut.row @ np.linalg.solve(pole * np.eye(len(cut.A)) - cut.A, cut.into))
    delay_s = cmath.phase(-at_pole) / pole.imag
    return delay_s, 1.0 / abs(at_pole * cmath.exp(-pole * delay_s))


def _row(
    loop: str, case: str, pole: complex, planes: Planes, gains: Gains, lag: Lag
) -> SinglePoleCondition:
    delay_s, gain = required_delay_and_gain(loop, planes, gains, pole, lag)
    faster = lag._replace(
        natural_frequency_radps=lag.natural_frequency_radps * (1.0 + BENCH_SD["natural_frequency"])
    )
    calmer = lag._replace(damping_ratio=lag.damping_ratio * (1.0 + BENCH_SD["damping_ratio"]))
    moved = [
        required_delay_and_gain(loop, planes, gains, pole, other)[0] - delay_s
        for other in (faster, calmer)
    ]
    return SinglePoleCondition(loop, case, delay_s, math.hypot(*moved), gain)
