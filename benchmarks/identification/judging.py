"""Cell: reliability of the model assessment: how often a wrong model passes and a good one fails.

A trial is one campaign as simulated for prediction, its fit, and an assessment with new runs in the
disturbed sea. The same model is then spoilt by random changes of its surface moments and delays and
assessed with the same runs. The true error of a model is that of gain and phase at crossover
relative to the simulated vehicle, in units of 1 dB or 5 degrees, in the worse plane.
"""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import crossover, prediction, vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.study import Cell, Figure
from sysid.data.runs import Run
from sysid.models import model_export
from sysid.models import prediction as predict
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES
from sysid.planes import PLANES, Plane
from sysid.validation.assess import with_assessment
from tests.sysid import sea

Array = NDArray[np.float64]

GAIN_DB, PHASE_DEG = 1.0, 5.0
SPOILT_Z = {"N_dr": 1.5, "M_de": 1.5, "delay_yaw": 1.0, "delay_pitch": 1.0}
"""Standard deviations of the changes, in prior standard deviations: 3 dB, and 0.1 s (7 degrees)."""
CLEAR = 1.5
"""Error above which the uncertainty of the held-out runs does not explain a wrong assessment."""


def fresh(case: Case, seed: int) -> list[Run]:
    """Return two 3-2-1-1 tests and two steps per plane that are not used for fitting."""
    runs = []
    for plane in Plane:
        scale = case.scale(plane)
        size, seconds = {Plane.YAW: (5.0, 2.0), Plane.PITCH: (4.0, 1.5)}[plane]
        signals = [sea.step(sign * size * scale, 8.0) for sign in (1.0, -1.0)]
        signals += [_three_two_one_one(sign * size * scale, seconds) for sign in (1.0, -1.0)]
        for number, signal in enumerate(signals):
            flown = sea.fly(
                case.truth,
                plane,
                signal,
                name=f"{plane}/{number}",
                wave="step" if number < 2 else "3211",
                seed=700_000 + 100 * seed + 10 * PLANES[plane].index + number,
                trim_rad=case.trim_rad,
                hold=case.hold,
            )
            runs.append(prediction.within(flown))
    return runs


def _three_two_one_one(degrees: float, unit_s: float) -> Array:
    """Return a 3-2-1-1 signal."""
    return np.concatenate(
        [sea.step(degrees * sign, n * unit_s) for n, sign in ((3, 1), (2, -1), (1, 1), (1, -1))]
    )


def miss(case: Case, model: IdentifiedModel) -> float:
    """Return the error at crossover in the worse plane, in units of 1 dB or 5 degrees."""
    identified = predict.vehicles(model, case.prior)[0]
    errors = [crossover.errors(case, identified, plane) for plane in Plane]
    return max(max(abs(gain) / GAIN_DB, abs(phase) / PHASE_DEG) for gain, phase in errors)


def spoilt(model: IdentifiedModel, rng: np.random.Generator) -> IdentifiedModel:
    """Return the model with random changes of its parameters."""
    moves = np.array([SPOILT_Z.get(name, 0.0) for name in NAMES])
    z = np.array(model.joint.z) + moves * rng.standard_normal(len(NAMES))
    return msgspec.structs.replace(
        model, joint=msgspec.structs.replace(model.joint, z=tuple(z.tolist()))
    )


def trial(vehicle: str, seed: int) -> list[float]:
    """Return the true error and the assessment (1.0: fit) of the fitted and of a spoilt model.

    The assessment uses the new runs and one fitted run per plane, because fitted runs do not affect
    its criteria.
    """
    case = vehicles.case(vehicle)
    done = prediction.campaign(vehicle, seed)
    model = model_export.from_fit(done.found, done.prior, case.prior_file)
    fitted = [group[0].run for group in done.found.datasets.values()]
    held_out, numbers = fresh(case, seed), []
    for candidate in (model, spoilt(model, np.random.default_rng(seed))):
        found = with_assessment(candidate, fitted, held_out, prior=case.prior).assessment
        numbers += [miss(case, candidate), float(found is not None and found.fit_for_redesign)]
    return numbers


def judge(vehicle: str, rows: Array) -> list[Figure]:
    """Return the rates of wrong assessments."""
    fitted, spoilt_ones = rows[:, :2], rows[:, 2:]
    every = np.vstack([fitted, spoilt_ones])
    return [
        Figure(
            "good fitted models that are rejected",
            _share(fitted[fitted[:, 0] <= 1.0], called=0.0),
            highest=10.0,
            unit="%",
        ),
        Figure(
            "models beyond 1 dB or 5 deg that are accepted",
            _share(every[every[:, 0] > 1.0], called=1.0),
            highest=10.0,
            unit="%",
        ),
        Figure(
            "models beyond 1.5 dB or 7.5 deg that are accepted",
            _share(every[every[:, 0] > CLEAR], called=1.0),
            highest=2.0,
            unit="%",
        ),
        Figure("models beyond 1 dB or 5 deg", 100.0 * float(np.mean(every[:, 0] > 1.0)), unit="%"),
        Figure(
            "fitted models beyond 1 dB or 5 deg",
            100.0 * float(np.mean(fitted[:, 0] > 1.0)),
            unit="%",
        ),
    ]


def _share(rows: Array, called: float) -> float:
    """Return the percentage of models with this assessment; NaN without models."""
    return 100.0 * float(np.mean(rows[:, 1] == called)) if len(rows) else math.nan


JUDGING = Cell(
    "judging",
    "assessment of good and of spoilt models",
    trial,
    judge,
    runs=50,
    campaigns=prediction.PREDICTION.campaigns,
)
