"""Cell: the recursive estimate compared with the batch estimate of the same runs and truth."""

import math
from collections.abc import Iterable
from time import process_time

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.study import Cell, Figure
from sitl.vehicle.config import VehicleFileError
from sysid.data.runs import Run
from sysid.estimation.map import fit, steady_state
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.estimation.recursive import (
    estimator,
    intervals,
    prediction,
    report,
)
from sysid.estimation.recursive.estimator import Knowledge
from sysid.estimation.recursive.intervals import Estimate
from sysid.estimation.recursive.report import PlaneReport
from sysid.models import parameters
from sysid.models.linear_planes import QUANTILE
from sysid.models.parameters import NAMES
from sysid.planes import PLANES, Plane
from tests.sysid import sea

Array = NDArray[np.float64]

TESTS: tuple[tuple[Plane, float, float], ...] = (
    (Plane.YAW, 3.0, 10.0),
    (Plane.YAW, -5.0, 5.0),
    (Plane.YAW, 7.0, 5.0),
    (Plane.YAW, 5.0, 2.5),
    (Plane.PITCH, 2.0, 5.0),
    (Plane.PITCH, -4.0, 2.5),
    (Plane.PITCH, 6.0, 5.0),
)
"""Doublets: plane, degrees for Caribou, seconds of each half."""
FIGURES = (*report.NAMES, "gain_db", "phase_deg")
COUNT = len(Plane) * len(FIGURES)
AGREED_SD = 1.0
"""Target: largest rms difference from the batch estimate, in its standard deviations."""


def campaign(case: Case, seed: int) -> list[Run]:
    """Simulate doublets of both planes in the disturbed sea."""
    return [
        sea.fly(
            case.truth,
            plane,
            sea.doublet(degrees * case.scale(plane), half_s),
            name=f"test/{number}",
            wave="doublet",
            seed=100 * seed + number,
            trim_rad=case.trim_rad,
            hold=case.hold,
        )
        for number, (plane, degrees, half_s) in enumerate(TESTS)
    ]


def trial(vehicle: str, seed: int) -> list[float]:
    """Return differences from batch (in its sd), errors (in own sd), and CPU time per test time."""
    case = vehicles.case(vehicle)
    runs = campaign(case, seed)
    first = vehicles.nominal(case.prior)
    zeros: dict[Plane, float] = {Plane.YAW: 0.0, Plane.PITCH: 0.0}
    prior = Prior(case.prior, zeros, np.zeros(len(NAMES)), parameters.prior_covariance())
    estimator.update(
        estimator.begin(estimator.prior_knowledge(prior), Plane.YAW, 0.0), prediction.steps(runs[0])
    )  # compiles the code
    began_s = process_time()
    known = learn(estimator.prior_knowledge(prior), runs)
    spent_s = process_time() - began_s
    together = prior._replace(biases_rad=steady_state.trim_biases(case.prior, first.model, runs))
    try:  # without other starts: those of all 800 fits of the cell led to the same optimum
        batch: Fit | None = fit.fit(runs, together, starts=0)
    except VehicleFileError:  # the batch search reached an impossible vehicle
        batch = None
    differences, errors = [], []
    for plane in Plane:
        at = report.crossover_radps(prior, plane)
        online = _figures(report.read(known.prior, intervals.estimate(known), plane, at))
        beside = np.full_like(online, math.nan)
        if batch is not None:
            joint = Estimate(batch.z, batch.covariance)
            beside = _figures(report.read(together, joint, plane, at))
        differences += ((online[0] - beside[0]) / beside[1]).tolist()
        errors += ((online[0] - _truth(case, plane, at)) / online[1]).tolist()
    flown_s = sum(float(run.time_s[-1] - run.time_s[0]) for run in runs)
    return [*differences, *errors, spent_s / flown_s]


def learn(knowledge: Knowledge, runs: Iterable[Run]) -> Knowledge:
    """Return the knowledge after all tests, in their order."""
    for run in runs:
        held_rad = float(np.mean(run.command_rad[run.preroll]))
        test = estimator.begin(knowledge, run.plane, held_rad)
        knowledge = estimator.finish(estimator.update(test, prediction.steps(run)))
    return knowledge


def _figures(found: PlaneReport) -> Array:
    """Return values and standard deviations, shape (2, FIGURES); NaN without bounded interval."""
    numbers = [*found.numbers.values(), found.gain_db, found.phase_deg]
    both = np.array([[n.value for n in numbers], [n.sd for n in numbers]])
    return np.where(np.isinf(both[1]), math.nan, both)


def _truth(case: Case, plane: Plane, crossover_radps: float) -> Array:
    """Return the true values of the design parameters."""
    tail = case.truth.tailcone
    values = report.numbers(vehicles.nominal(case.truth), plane, crossover_radps)
    biases_deg = tail.rudder_bias_deg, tail.elevator_bias_deg
    values[FIGURES.index("actuator_bias_deg")] = biases_deg[PLANES[plane].index]
    return values


def judge(vehicle: str, trials: Array) -> list[Figure]:
    """Return agreement, coverage and time, over the design parameters of both planes."""
    differences, errors = trials[:, :COUNT], trials[:, COUNT : 2 * COUNT]
    compared = np.maximum(1, np.sum(np.isfinite(differences), axis=0))
    apart = np.sqrt(np.nansum(differences**2, axis=0) / compared)
    inside = np.where(np.isnan(errors), math.nan, np.abs(errors) < QUANTILE)
    worst = int(np.argmax(apart))
    plane, name = tuple(Plane)[worst // len(FIGURES)], FIGURES[worst % len(FIGURES)]
    return [
        Figure(
            "rms difference from the batch estimate",
            float(np.sqrt(np.nanmean(differences**2))),
            0.0,
            AGREED_SD,
            "sd",
        ),
        Figure(f"largest of them, {plane} {name}", float(apart[worst]), unit="sd"),
        Figure(
            "coverage of 95 % intervals",
            100.0 * float(np.nanmean(inside)),
            90.0,
            100.0,
            "%",
        ),
        Figure("CPU seconds per second of test", float(np.nanmean(trials[:, -1])), 0.0, 0.05),
    ]


ONLINE = Cell("online", "recursive estimate compared with batch and truth", trial, judge)
