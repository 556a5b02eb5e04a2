"""Cell: how often an anomaly in one run is detected, and how often a clean run is flagged.

Each campaign is simulated with the nonlinear true vehicle in the disturbed sea. One rudder and one
elevator run are then repeated in the same conditions, once with actuator slip in the middle and
once with a gain error. The screening uses the fit of a campaign with another seed, updated to each
campaign by one Gauss-Newton step, as `find_outliers` always does: a fit of each campaign would give
the same result in a hundred times the time.
"""

import math
from collections.abc import Sequence
from functools import cache, partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.study import Cell, Figure
from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.map import fit
from sysid.estimation.map.datasets import dataset, with_coupling_inputs
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.planes import Plane
from sysid.prior_knowledge import prior_of
from sysid.screening.anomaly_models import Kind
from sysid.screening.outlier_tests import FALSE_ALARM, RunScreening, find_outliers_among
from sysid.screening.score_test import scores
from sysid.screening.whitened_residuals import (
    Residuals,
    RunResiduals,
    linearise_runs,
    update_parameters,
)
from tests.sysid import sea
from tests.sysid.sea import Fault

Array = NDArray[np.float64]
Wave = Literal["step", "3-2-1-1"]

SLIP_DEG = 0.5
"""Slip for Caribou; on other vehicles the slip has the same effect on the turn."""
GAIN = 1.10
"""Ratio of true to commanded surface angle."""
WAVES: tuple[Wave, ...] = ("step", "3-2-1-1")
KINDS: tuple[Kind, ...] = ("actuator slip", "gain error")
REFERENCE_SEED = 999_000


class Test(NamedTuple):
    """Plane and signal of a test."""

    plane: Plane
    signal_rad: Array

    @property
    def middle_s(self) -> float:
        """Time of the middle of the signal."""
        return 0.5 * self.signal_rad.size / RATE_HZ


def tests(case: Case, wave: Wave) -> list[Test]:
    """Return four tests per plane: two sizes with both signs."""
    sizes: dict[Plane, tuple[float, ...]] = {Plane.YAW: (5.0, 8.0), Plane.PITCH: (3.0, 5.0)}
    return [
        Test(plane, case.scale(plane) * _signal(plane, wave, sign * size))
        for plane in Plane
        for size in sizes[plane]
        for sign in (1.0, -1.0)
    ]


def _signal(plane: Plane, wave: Wave, degrees: float) -> Array:
    """Return steps of 40 s (yaw) or 8 s (pitch), or repeated 3-2-1-1 with units of 2.5 or 1.5 s."""
    if wave == "step":
        return sea.step(degrees, {Plane.YAW: 40.0, Plane.PITCH: 8.0}[plane])
    unit_s, times = {Plane.YAW: (2.5, 3), Plane.PITCH: (1.5, 2)}[plane]
    pulses = ((1, 3), (-1, 2), (1, 1), (-1, 1)) * times
    return np.concatenate([sea.step(sign * degrees, n * unit_s) for sign, n in pulses])


def flown(case: Case, test: Test, wave: Wave, seed: int, fault: Fault | None = None) -> Run:
    """Simulate a test, with or without a fault."""
    return sea.fly(
        case.truth,
        test.plane,
        test.signal_rad,
        name=f"{test.plane}/{seed}",
        wave=wave,
        seed=seed,
        trim_rad=case.trim_rad,
        hold=case.hold,
        fault=fault,
    )


@cache
def reference(vehicle: str, wave: Wave) -> tuple[Fit, Prior]:
    """Return the fit of a clean campaign, which all trials of a cell use."""
    case = vehicles.case(vehicle)
    runs = [flown(case, test, wave, REFERENCE_SEED + k) for k, test in enumerate(tests(case, wave))]
    prior = prior_of(runs, case.prior)
    return fit.fit(runs, prior), prior


def trial(wave: Wave, vehicle: str, seed: int) -> Sequence[float]:
    """Return counts of clean, flagged and dropped runs, then the results for each anomaly.

    Per kind and plane: whether the run was flagged, whether it was left out, and whether a test for
    this kind at this time alone would have detected it.
    """
    case, asked = vehicles.case(vehicle), tests(vehicles.case(vehicle), wave)
    seeds = [1000 * seed + k for k in range(len(asked))]
    clean = [flown(case, test, wave, s) for test, s in zip(asked, seeds, strict=True)]
    struck = {plane: _struck(plane, asked, seed) for plane in Plane}
    campaigns = [clean]
    for kind in KINDS:
        runs = list(clean)
        for plane, k in struck.items():
            slip_rad = math.radians(SLIP_DEG) * case.scale(plane)
            fault = (
                Fault(gain=GAIN)
                if kind == "gain error"
                else Fault(1.0, slip_rad, asked[k].middle_s)
            )
            runs[k] = flown(case, asked[k], wave, seeds[k], fault)
        campaigns.append(runs)
    found, prior = reference(vehicle, wave)
    before, *after = _linearised(found, prior, campaigns)
    screenings = find_outliers_among(before, found, prior).screenings
    numbers = [
        float(len(clean)),
        float(sum(map(_flagged, screenings))),
        float(sum(bool(v.reason) for v in screenings)),
    ]
    for kind, residuals in zip(KINDS, after, strict=True):
        verdicts = find_outliers_among(residuals, found, prior).screenings
        evidence = update_parameters(residuals, found, prior)
        for k in struck.values():
            ideal = _detected_ideally(evidence, residuals[k], kind, asked[k].middle_s)
            numbers += [float(_flagged(verdicts[k])), float(bool(verdicts[k].reason)), float(ideal)]
    return numbers


def _flagged(verdict: RunScreening) -> bool:
    """Return whether the run is flagged as anomalous."""
    return verdict.scores.p_value <= FALSE_ALARM


def _detected_ideally(evidence: Residuals, run: RunResiduals, kind: Kind, at_s: float) -> bool:
    """Return whether a test for one kind of anomaly at its true time detects it: the ideal case."""
    mark = next(s for s in run.signatures if s.kind == kind)
    k = int(np.argmin(np.abs(mark.times_s - at_s))) if mark.times_s.size > 1 else 0
    mark = mark._replace(times_s=mark.times_s[k : k + 1], white=mark.white[k : k + 1])
    return (
        scores([mark], evidence.residual_at_optimum(run), run.slopes, evidence.covariance).p_value
        <= FALSE_ALARM
    )


def _struck(plane: Plane, asked: Sequence[Test], seed: int) -> int:
    """Return the index of the run with the anomaly; it varies with the seed."""
    there = [k for k, test in enumerate(asked) if test.plane == plane]
    return there[seed % len(there)]


def _linearised(
    found: Fit, prior: Prior, campaigns: Sequence[Sequence[Run]]
) -> list[list[RunResiduals]]:
    """Linearise the runs of campaigns about a fit; a run of several campaigns is done once."""
    distinct = {id(run): run for runs in campaigns for run in runs}
    by_plane = [key for plane in Plane for key, run in distinct.items() if run.plane == plane]
    residuals = linearise_runs(_of(found, list(distinct.values())), prior)
    by_run = dict(zip(by_plane, residuals, strict=True))
    return [[by_run[id(run)] for run in runs] for runs in campaigns]


def _of(found: Fit, runs: Sequence[Run]) -> Fit:
    """Return the reference fit with the runs of a campaign."""
    datasets = {
        plane: tuple(
            with_coupling_inputs(found.vehicle, dataset(r)) for r in runs if r.plane == plane
        )
        for plane in Plane
    }
    return found._replace(datasets=datasets)


def judge(vehicle: str, rows: Array) -> Sequence[Figure]:
    """Return the rate of false alarms and the detection power."""
    runs, flagged, dropped = np.sum(rows[:, :3], axis=0)
    power = np.mean(rows[:, 3:], axis=0).reshape(len(KINDS), len(Plane), 3)
    sampling = math.sqrt(FALSE_ALARM / runs)
    figures = [
        Figure("clean runs flagged", flagged / runs, highest=FALSE_ALARM + 2.0 * sampling),
        Figure("clean runs left out", dropped / runs),
    ]
    for what, by_plane in zip(("slip of 0.5 deg", "gain error of 10 %"), power, strict=True):
        for plane, (found, left_out, ideal) in zip(Plane, by_plane, strict=True):
            figures += [
                Figure(f"{plane}: {what} detected", found, lowest=0.9),
                Figure(f"{plane}: {what} detected, kind and time known", ideal),
                Figure(f"{plane}: {what} left out", left_out),
            ]
    return figures


CELLS = tuple(
    Cell(
        f"screening-{wave}",
        "anomalies detected in one run, and clean runs flagged",
        partial(trial, wave),
        judge,
    )
    for wave in WAVES
)
