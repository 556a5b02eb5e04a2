"""Test sets of the excitation cell: designed tests and the paper's tests, and their simulation.

Each set takes DIVE_S of test time in two dives, settling between tests included. The first designed
dive is based on the vehicle file, the second on a model fitted to a first dive with its own seed.
All trials use the same two sets.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from benchmarks.identification import vehicles
from benchmarks.identification.vehicles import Case
from sysid.data.runs import Run
from sysid.estimation.map import fit
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.prior_knowledge import prior_of
from sysid.test_design import plan, simulate
from sysid.test_design import prior as beliefs
from sysid.test_design.plan import PlanRequest
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import Manoeuvre
from tests.sysid import sea

DIVE_S, FIRST_S = 1000.0, 262.0
"""Test time with settling, and the part of it in the first dive."""
FIRST_SEED = 10**7
"""Seed of the dive on which the second design is based."""


class Sets(NamedTuple):
    """Both sets of tests for one vehicle."""

    designed: tuple[Manoeuvre, ...]
    paper: tuple[Manoeuvre, ...]


@cache
def sets(vehicle: str) -> Sets:
    """Return both sets of tests for a vehicle."""
    case = vehicles.case(vehicle)
    known = beliefs.with_trim(beliefs.from_file(case.prior, case.name), *case.trim_rad)
    first = _tests(case, known, FIRST_S)
    second = _tests(case, _learnt(case, first), DIVE_S - FIRST_S - plan.SETTLING_S)
    return Sets(first + second, tuple(plan.paper_set(known, DIVE_S)))


def _tests(case: Case, known: DesignPrior, test_time_s: float) -> tuple[Manoeuvre, ...]:
    """Design tests for a given test time."""
    asked = PlanRequest(
        test_time_s + plan.SETTLING_S, "crossover", gains=gains(case), held_out=False
    )
    return tuple(planned.manoeuvre for planned in plan.plan(known, asked).tests)


def _learnt(case: Case, flown: Sequence[Manoeuvre]) -> DesignPrior:
    """Return the prior after a dive with these tests."""
    prior, found = fitted(
        case, [run for n, one in enumerate(flown) for run in fly(case, one, FIRST_SEED + n)]
    )
    return DesignPrior(
        case.name, case.prior, prior.biases_rad, found.z, found.covariance, found.noise, True
    )


def fitted(case: Case, runs: Sequence[Run]) -> tuple[Prior, Fit]:
    """Return the prior from the vehicle file and the nonlinear estimate from the runs.

    Other starts are not searched: those of all 320 fits of the cell led to the same optimum.
    """
    prior = prior_of(runs, case.prior)
    return prior, fit.fit(runs, prior, starts=0)


def gains(case: Case) -> dict[str, float]:
    """Return the gains of the first dive by parameter name."""
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
    """Simulate one complete test in the disturbed sea; return one run per plane that it excites."""
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
