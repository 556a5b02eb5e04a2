"""Whether the verdict can be trusted: how often a model that misses crossover is called fit, and a
good one refused.

A trial is one campaign as flown for prediction, its fit, and fresh runs in the disturbed sea to
judge it by. The same model is then spoilt, its surfaces' moments and delays moved at random, and
judged again by the same runs. What a model really misses is the gain and phase of the vehicle that
flew, at crossover: a miss of one is 1 dB or 5 degrees in one of the planes."""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import crossover, prediction, vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.study import Cell, Figure
from sysid.data.segments import Plane, Run
from sysid.models import model_export
from sysid.models import prediction as predict
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES
from sysid.validation.assess import with_assessment
from tests.sysid import sea

Array = NDArray[np.float64]

PLANES: tuple[Plane, ...] = ("yaw", "pitch")
GAIN_DB, PHASE_DEG = 1.0, 5.0
SPOILT_Z = {"N_dr": 1.5, "M_de": 1.5, "delay_yaw": 1.0, "delay_pitch": 1.0}
"""Standard deviations by which a model is spoilt, in prior standard deviations: 3 dB, and 0.1 s or
some 7 degrees."""
CLEAR = 1.5
"""Misses beyond it cannot be excused by the doubt that held-out runs leave."""


def fresh(case: Case, seed: int) -> list[Run]:
    """Two 3-2-1-1 and two steps a plane, none of them fitted."""
    runs = []
    for plane in PLANES:
        scale = case.scale(plane)
        size, seconds = (5.0, 2.0) if plane == "yaw" else (4.0, 1.5)
        signals = [sea.step(sign * size * scale, 8.0) for sign in (1.0, -1.0)]
        signals += [_three_two_one_one(sign * size * scale, seconds) for sign in (1.0, -1.0)]
        for number, signal in enumerate(signals):
            flown = sea.fly(
                case.truth,
                plane,
                signal,
                name=f"{plane}/{number}",
                wave="step" if number < 2 else "3211",
                seed=700_000 + 100 * seed + 10 * PLANES.index(plane) + number,
                trim_rad=case.trim_rad,
                hold=case.hold,
            )
            runs.append(prediction.within(flown))
    return runs


def _three_two_one_one(degrees: float, unit_s: float) -> Array:
    return np.concatenate(
        [sea.step(degrees * sign, n * unit_s) for n, sign in ((3, 1), (2, -1), (1, 1), (1, -1))]
    )


def miss(case: Case, model: IdentifiedModel) -> float:
    """Of crossover in the worse plane, in units of 1 dB or 5 degrees."""
    identified = predict.vehicles(model, case.prior)[0]
    errors = [crossover.errors(case, identified, plane) for plane in PLANES]
    return max(max(abs(gain) / GAIN_DB, abs(phase) / PHASE_DEG) for gain, phase in errors)


def spoilt(model: IdentifiedModel, rng: np.random.Generator) -> IdentifiedModel:
    moves = np.array([SPOILT_Z.get(name, 0.0) for name in NAMES])
    z = np.array(model.joint.z) + moves * rng.standard_normal(len(NAMES))
    return msgspec.structs.replace(
        model, joint=msgspec.structs.replace(model.joint, z=tuple(z.tolist()))
    )


def trial(vehicle: str, seed: int) -> list[float]:
    """Of the fitted model and of a spoilt one: by how much it misses crossover, and 1.0 where it is
    called fit.

    Judged by the fresh runs and, as the fitted ones decide no gate, by one of those a plane.
    """
    case = vehicles.case(vehicle)
    done = prediction.campaign(case, seed)
    model = model_export.from_fit(done.found, done.prior, case.prior_file)
    fitted = [group[0].run for group in done.found.datasets.values()]
    held_out, numbers = fresh(case, seed), []
    for candidate in (model, spoilt(model, np.random.default_rng(seed))):
        found = with_assessment(candidate, fitted, held_out, prior=case.prior).verdict
        numbers += [miss(case, candidate), float(found is not None and found.fit_for_redesign)]
    return numbers


def judge(vehicle: str, rows: Array) -> list[Figure]:
    fitted, spoilt_ones = rows[:, :2], rows[:, 2:]
    every = np.vstack([fitted, spoilt_ones])
    return [
        Figure(
            "good fitted models that are refused",
            _share(fitted[fitted[:, 0] <= 1.0], called=0.0),
            highest=10.0,
            unit="%",
        ),
        Figure(
            "models beyond 1 dB or 5 deg that are called fit",
            _share(every[every[:, 0] > 1.0], called=1.0),
            highest=10.0,
            unit="%",
        ),
        Figure(
            "models beyond 1.5 dB or 7.5 deg that are called fit",
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
    """Of models, in per cent; not a number without any."""
    return 100.0 * float(np.mean(rows[:, 1] == called)) if len(rows) else math.nan


JUDGING = Cell("judging", "verdicts on good and on spoilt models", trial, judge, runs=50)
