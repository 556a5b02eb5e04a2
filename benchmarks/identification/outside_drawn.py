"""Cell: identification of drawn plants with a file of `ground vehicle new`.

A trial draws a hull and its fins, which the vehicle file states, and a plant on it whose forces,
servo and sensors it does not (`drawn_plants`). First gains and tests are those of a
campaign: designed and scaled by the file. A model that passes is redesigned as `ground redesign`
does, and its gains are examined on the plant as in `verdicts`.
"""

import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.campaigns import drawn as drawn_hulls
from benchmarks.identification import drawn_plants, outside, vehicles, verdicts
from benchmarks.identification.outside import LABELS, PRIORS
from benchmarks.identification.vehicles import Case
from benchmarks.plants import catalogue, logs
from benchmarks.plants.catalogue import SPECIFICATIONS, Plant
from benchmarks.plants.flight import Gains
from benchmarks.plants.logs import TestScaling
from benchmarks.study import Cell, Figure
from ground.campaign import prototype
from mavlink_io.errors import CaribouError
from sitl.vehicle import config
from sysid import refit
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2
from sysid.test_design.vehicle_scale import vehicle_scale
from tests.sysid.sea import Hold

Array = NDArray[np.float64]

LEVELS = 0.4, 1.5
"""Range of the size of the disturbance (log-uniform), relative to the other plants' sea."""
MAX_HEADING_ERROR_RAD = 0.2
"""Heading error on which the loop acts: behind a reference of limited rate it stays small."""


class Flown(NamedTuple):
    """A drawn plant, and what somebody knows who flies it."""

    plant: Plant
    case: Case
    level: float
    """Size of the disturbance."""


def draw(kind: str, number: int, folder: Path) -> Flown:
    """Draw hull and plant, write the vehicle file, and design the first gains.

    Raises InputError or OperationError for a hull without feasible first gains.
    """
    path = folder / "vehicle.toml"
    path.write_text(drawn_hulls.text(number, is_tailcone_known=False), encoding="utf-8")
    file = config.load(str(path))
    spec = drawn_plants.specification(
        SPECIFICATIONS[kind].kind, number, file, vehicles.nominal(file)
    )
    low, high = LEVELS
    level = low * (high / low) ** np.random.default_rng([number, 60_000]).random()
    designed = prototype.design(str(path)).parameters
    hold = Hold(*(designed[name] for name in verdicts.HOLD_GAINS))
    return Flown(
        plant=catalogue.assemble(kind, spec),
        case=Case("drawn", str(path), file, file, hold),
        level=level * min(1.0, spec.b1_per_s2 / CARIBOU_TURN_PER_S2),
    )


def identified(flown: Flown, number: int, folder: Path) -> IdentifiedModel:
    """Fly and record the tests of a campaign, scaled by the vehicle file, and identify the plant.

    Raises CaribouError.
    """
    scale = vehicle_scale(flown.case.prior, config.load("caribou_nominal"))
    yaw, pitch = (
        TestScaling(part.step_size, part.sweep_size, scale.time, part.frequency)
        for part in (scale.planes[plane] for plane in Plane)
    )
    fitted, held_out = logs.campaign(
        folder,
        flown.plant,
        scalings=(yaw, pitch),
        gains=Gains(*flown.case.hold, max_heading_error_rad=MAX_HEADING_ERROR_RAD),
        seed=number,
        level=flown.level,
    )
    return refit.refit(
        refit.RefitRequest(paths=fitted, held_out=held_out, prior=flown.case.prior_file)
    )


def trial(kind: str, number: int) -> list[float]:
    """Return errors, standard deviations, and whether the model passed and its redesign holds.

    The numbers of a refused campaign are unknown (NaN).
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            flown = draw(kind, number, folder)
            model = identified(flown, number, folder)
        except CaribouError:
            return [math.nan] * (2 * len(LABELS)) + [0.0, math.nan]
    wrong, sds = outside.errors(model, flown.case, flown.plant)
    if model.assessment is None or not model.assessment.fit_for_redesign:
        return [*wrong.tolist(), *sds.tolist(), 0.0, math.nan]
    first = verdicts.first_gains(flown.case.hold)
    gains = verdicts.redesigned(model, flown.case.prior, first)
    held = math.nan if gains is None else float(verdicts.holds(flown.plant, gains))
    return [*wrong.tolist(), *sds.tolist(), 1.0, held]


def judge(kind: str, rows: Array) -> list[Figure]:
    """Return the figures of `outside` for the models that pass, and the share of these."""
    passed, held = rows[:, -2] == 1.0, rows[:, -1]
    return [
        Figure("models that pass", 100.0 * float(np.mean(passed)), lowest=90.0, unit="%"),
        Figure(
            "redesigns of these that hold",
            100.0 * float(np.mean(held[passed] == 1.0)) if np.any(passed) else math.nan,
            lowest=90.0,
            unit="%",
        ),
        *(outside.accuracy(rows[passed]) if np.any(passed) else ()),
    ]


OUTSIDE_DRAWN = Cell(
    "outside-drawn",
    "drawn plants, with vehicle files that assume the tailcone",
    trial,
    judge,
    runs=10,
    cases=tuple(PRIORS),
)
"""Hulls, forces, servos and sensors that nobody chose."""
