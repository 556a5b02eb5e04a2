"""The tests that the excitation cell sets beside the paper's, and how they are flown.

Two dives of DIVE_S together, the settling between them counted: the first is designed on the
vehicle's file, the second on the model that a first dive gave. That dive is no trial's: every trial
flies the same two sets."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from benchmarks.identification import vehicles
from benchmarks.identification.vehicles import Case
from sitl.vehicle import build_model
from sysid.data.segments import Run
from sysid.estimation.map import fit
from sysid.estimation.map.fit import Fit, Prior
from sysid.models import parameters
from sysid.models.parameters import NAMES
from sysid.test_design import plan, simulate
from sysid.test_design import prior as beliefs
from sysid.test_design.plan import PlanRequest
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import Manoeuvre
from tests.sysid import sea

DIVE_S, FIRST_S = 1000.0, 262.0
"""Water for tests and recoveries; and how much of it the first of two dives takes."""
FIRST_SEED = 10**7
"""Of the dive on which the second is designed."""


class Sets(NamedTuple):
    designed: tuple[Manoeuvre, ...]
    paper: tuple[Manoeuvre, ...]


@cache
def sets(vehicle: str) -> Sets:
    case = vehicles.case(vehicle)
    known = beliefs.with_trim(beliefs.from_file(case.prior, case.name), *case.trim_rad)
    first = _tests(case, known, FIRST_S)
    second = _tests(case, _learnt(case, first), DIVE_S - FIRST_S - plan.SETTLING_S)
    return Sets(first + second, tuple(plan.paper_set(known, DIVE_S)))


def _tests(case: Case, known: DesignPrior, water_s: float) -> tuple[Manoeuvre, ...]:
    asked = PlanRequest(water_s + plan.SETTLING_S, "crossover", gains=gains(case), held_out=False)
    return tuple(planned.manoeuvre for planned in plan.plan(known, asked).tests)


def _learnt(case: Case, flown: Sequence[Manoeuvre]) -> DesignPrior:
    prior, found = fitted(
        case, [run for n, one in enumerate(flown) for run in fly(case, one, FIRST_SEED + n)]
    )
    return DesignPrior(
        case.name, case.prior, prior.biases_rad, found.z, found.covariance, found.noise, True
    )


def fitted(case: Case, runs: Sequence[Run]) -> tuple[Prior, Fit]:
    """By the joint estimator from the vehicle's file."""
    biases = fit.trim_biases(case.prior, build_model.build(case.prior), list(runs))
    prior = Prior(case.prior, biases, np.zeros(len(NAMES)), parameters.prior_covariance())
    return prior, fit.fit(runs, prior)


def gains(case: Case) -> dict[str, float]:
    """The first dive's, by the names of the autopilot's parameters."""
    hold = case.hold
    return {
        "HDG_P": hold.heading_p,
        "HDG_D": hold.heading_d,
        "HDG_I": hold.heading_i,
        "PTCH_P": hold.pitch_p,
        "PTCH_D": hold.pitch_d,
        "PTCH_I": 0.0,
        "DPT_P": hold.depth_p,
        "DPT_D": 0.0,
        "DPT_I": hold.depth_i,
    }


def fly(case: Case, what: Manoeuvre, seed: int) -> list[Run]:
    """One test in the disturbed sea, to its end: a run of each plane that it is of."""
    signals = [simulate.signal_rad(half) for half in what.halves]
    if len(signals) == 1:
        return [
            sea.fly(
                case.truth,
                what.plane,
                signals[0],
                name=f"{what.plane}/{seed}",
                wave=what.wave,
                seed=seed,
                trim_rad=case.trim_rad,
                hold=case.hold,
                loop_on=what.loop_on,
            )
        ]
    closed = np.full(signals[0].size, np.nan)
    log = sea.fly_tests(
        case.truth,
        sea.Tests(closed, closed),
        rng=np.random.default_rng(seed),
        trim_rad=case.trim_rad,
        hold=case.hold,
        added=sea.Tests(*signals),
    )
    return [
        replace(
            sea.run_of(
                log,
                case.truth,
                half.plane,
                signal,
                name=f"{half.plane}/{seed}",
                wave=what.wave,
                trim_rad=case.trim_rad,
            ),
            both=True,
        )
        for half, signal in zip(what.halves, signals, strict=True)
    ]
