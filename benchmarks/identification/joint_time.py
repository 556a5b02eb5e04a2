"""Cell: run time of the nonlinear estimate of ten 60 s runs, five per plane, with compiled code."""

from functools import cache
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import prediction, vehicles
from benchmarks.study import Cell, Figure
from sysid import prior_knowledge
from sysid.data.runs import Run
from sysid.estimation.map import fit
from sysid.planes import Plane
from tests.sysid import sea

Array = NDArray[np.float64]

SECONDS = 60.0
MOST_S = 3.0
SIZES_DEG = (2.0, 3.0, 4.0, 5.0, 6.0)


@cache
def _runs(vehicle: str) -> tuple[Run, ...]:
    """Return the runs; pre-roll and test together last a minute."""
    case = vehicles.case(vehicle)
    tests = [
        (plane, ("chirp", size, SECONDS - sea.PREROLL_S)) for plane in Plane for size in SIZES_DEG
    ]
    return tuple(
        prediction.flown_test(case, plane, test, 900 + number)
        for number, (plane, test) in enumerate(tests)
    )


def trial(vehicle: str, seed: int) -> list[float]:
    """Return the seconds of the estimate, and of its eight further starts."""
    del seed  # all trials use the same runs; only the machine's speed varies
    case, runs = vehicles.case(vehicle), _runs(vehicle)
    prior = prior_knowledge.prior_of(runs, case.prior)
    fit.fit(runs[4:6], prior)
    began_s = perf_counter()
    fit.fit(runs, prior, starts=0)
    alone_s = perf_counter()
    fit.fit(runs, prior)
    return [alone_s - began_s, perf_counter() - alone_s - (alone_s - began_s)]


def judge(vehicle: str, rows: Array) -> list[Figure]:
    """Return the median times."""
    alone, others = np.median(rows, axis=0).tolist()
    return [
        Figure("joint estimate of 10 runs of 60 s, warm", alone, highest=MOST_S, unit="s"),
        Figure("its eight further starts", others, unit="s"),
    ]


JOINT_TIME = Cell("joint-time", "seconds of the nonlinear estimate", trial, judge, runs=5)
