"""Cell: how often a campaign's gains meet the specification on the true vehicle, as predicted.

A trial is a whole campaign: trims, tests, fit, assessment, redesign. The limits that the design
applies to every sampled vehicle are then checked on the linearised true vehicle. The probability
that the design predicts is compared with the fraction of campaigns that meet the limits. The gains
also fly a straight run.
"""

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import vehicles
from benchmarks.redesign import campaign, holding
from benchmarks.redesign.campaign import OURS, PRIOR, SEA, VEHICLE
from benchmarks.redesign.holding import DISTURBED, TrackingError
from benchmarks.study import Cell, Figure
from sitl import scenario
from sitl.vehicle import config
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import min_bounds
from sysid.design.design_model import DEFAULT_DISTURBANCE, from_vehicle
from sysid.design.pid import Design, DesignInfeasibleError
from sysid.design.robustness import RELAXED, violations
from sysid.planes import Plane

Array = NDArray[np.float64]

CASES = (VEHICLE,)
LEAST_FULL, LEAST_RELAXED = 75.0, 97.0
HONEST = 10.0
"""Largest difference of predicted and observed fraction, in percentage points."""


def trial(case: str, seed: int) -> list[float]:
    """Return: model fit for redesign, designed, predicted and true fractions, ``TrackingError``."""
    flown = campaign.fly(seed)
    fit = float(flown.model.assessment is not None and flown.model.assessment.fit_for_redesign)
    try:
        designed = campaign.redesigned(flown)
    except DesignInfeasibleError:
        return [fit, 0.0, *(np.nan,) * (4 + len(TrackingError._fields))]
    dive = holding.straight_run({**designed.gains, **flown.trims}, scenario.load(SEA), seed)
    return [fit, 1.0, *_kept(designed, case), *holding.tracking_error(dive)]


def _kept(designed: Design, vehicle: str) -> tuple[float, float, float, float]:
    """Return predicted probability and result of the full and of the relaxed specification."""
    assert designed.robustness is not None
    plane = from_vehicle(
        vehicles.nominal(config.load(vehicle)),
        {Plane.YAW: DEFAULT_DISTURBANCE, Plane.PITCH: DEFAULT_DISTURBANCE},
    )
    full, relaxed = (
        float(max(violations(plane, designed.gains, bounds).values()) <= CONSTRAINT_TOLERANCE)
        for bounds in (min_bounds(designed.spec), RELAXED)
    )
    return designed.robustness.specification, full, designed.robustness.relaxed, relaxed


def judge(case: str, rows: Array) -> list[Figure]:
    """Return the predicted and the observed fractions, and the tracking errors."""
    fit, done = rows[:, 0], rows[rows[:, 1] == 1.0]
    stated_full, full, stated_relaxed, relaxed = (
        100.0 * float(np.mean(done[:, k])) for k in range(2, 6)
    )
    return [
        Figure("models fit for redesign", 100.0 * float(np.mean(fit)), unit="%"),
        Figure("redesigns refused", 100.0 * float(np.mean(rows[:, 1] == 0.0)), unit="%"),
        Figure(
            "full specification kept by the vehicle that flew", full, lowest=LEAST_FULL, unit="%"
        ),
        Figure("full specification, stated", stated_full, lowest=LEAST_FULL, unit="%"),
        Figure(
            "full specification, kept less stated", full - stated_full, -HONEST, np.inf, unit="%"
        ),
        Figure(
            "relaxed specification kept by the vehicle that flew",
            relaxed,
            lowest=LEAST_RELAXED,
            unit="%",
        ),
        Figure("relaxed specification, stated", stated_relaxed, lowest=LEAST_RELAXED, unit="%"),
        *holding.figures({OURS: done[:, 6:]}, DISTURBED),
    ]


CELL = Cell(
    "probability",
    f"campaigns on the {VEHICLE} vehicle, designed from {PRIOR}",
    trial,
    judge,
    runs=20,
)
