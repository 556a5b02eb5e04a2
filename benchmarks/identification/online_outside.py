"""Cell: the recursive estimate of plants from outside compared with their true numbers."""

import math
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import online, outside
from benchmarks.identification.outside import PRIORS, QUANTILE, Truth
from benchmarks.plants import catalogue, logs
from benchmarks.plants.flight import Gains
from benchmarks.study import Cell, Figure
from sysid.data import readers, segments
from sysid.estimation.recursive import intervals, prior, report
from sysid.estimation.recursive.report import PlaneReport
from sysid.planes import Plane

Array = NDArray[np.float64]

NUMBERS = ("b1_per_s2", "p_fast_per_s", "p_slow_per_s")
"""Design numbers that are compared, besides gain and phase at crossover."""


def trial(name: str, seed: int) -> list[float]:
    """Return the errors of both planes' numbers in standard deviations of the estimate."""
    case, plant = outside.case_of(name), catalogue.plant(name, seed)
    with tempfile.TemporaryDirectory() as folder:
        fitted, _ = logs.campaign(
            Path(folder),
            plant,
            scalings=outside.scalings_of(case),
            gains=Gains(*case.hold),
            seed=seed,
        )
        runs = [run for path in fitted for run in segments.cut_runs(readers.read(path))]
    knowledge = online.learn(prior.knowledge(case.prior_file), runs)
    true, estimate = outside.truth(plant, case), intervals.estimate(knowledge)
    errors = list[float]()
    for plane in Plane:
        found = report.read(knowledge.prior, estimate, plane, true.crossover_radps[plane])
        errors += _errors(found, true)
    return errors


def _errors(found: PlaneReport, true: Truth) -> list[float]:
    """Return the errors of NUMBERS, gain and phase of a plane in their standard deviations."""
    response = true.response[found.plane]
    off_deg = found.phase_deg.value - math.degrees(np.angle(response))
    return [
        *(
            (found.numbers[name].value - true.numbers[f"{found.plane} {name}"])
            / found.numbers[name].sd
            for name in NUMBERS
        ),
        (found.gain_db.value - 20.0 * math.log10(abs(response))) / found.gain_db.sd,
        math.remainder(off_deg, 360.0) / found.phase_deg.sd,
    ]


def judge(name: str, rows: Array) -> list[Figure]:
    """Return the share of the numbers in their intervals."""
    inside = 100.0 * np.mean(np.abs(rows) <= QUANTILE, axis=0)
    labels = [f"{plane} {n}" for plane in Plane for n in (*NUMBERS, "gain", "phase")]
    return [
        Figure("numbers in their 95 % intervals", float(np.mean(inside)), 90.0, 100.0, "%"),
        *(
            Figure(f"{label}: in its interval", float(share), unit="%")
            for label, share in zip(labels, inside, strict=True)
        ),
    ]


ONLINE_OUTSIDE = Cell(
    "online-outside",
    "recursive estimate of plants that share no code with the simulator",
    trial,
    judge,
    runs=20,
    cases=tuple(PRIORS),
)
