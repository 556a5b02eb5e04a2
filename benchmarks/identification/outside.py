"""Cell: identification of plants from outside, whose physics the estimator does not know.

A trial is one campaign of a plant of ``benchmarks.plants``: its logs, read, screened, fitted and
validated by `sysid.refit` with the vehicle file of an engineer who has not seen the plant. The true
numbers come from the numerical linearisation of the plant at the speed and trim of the tests.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from benchmarks.identification import crossover as model_crossover
from benchmarks.identification import vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.plants import catalogue, logs, small_signal
from benchmarks.plants.catalogue import Plant
from benchmarks.plants.flight import Gains
from benchmarks.plants.logs import TestScaling
from benchmarks.study import Cell, Figure
from mavlink_io.errors import CaribouError
from sysid import refit
from sysid.models import delta_method, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

PRIORS = {
    "race": "caribou",
    "stall": "xfin_auv",
    "lumped": "remus100",
    "vortex": "my_vehicle",
}
"""Vehicle of ``vehicles.cases`` whose file and first gains each plant is identified with."""
NUMBERS = {
    Plane.YAW: ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s", "delay_s"),
    Plane.PITCH: (
        "static_gain_per_s",
        "b1_per_s2",
        "p_fast_per_s",
        "p_slow_per_s",
        "restoring_per_s2",
        "delay_s",
    ),
}
"""Design numbers with intervals."""
LABELS = tuple(
    [f"{plane} {name}" for plane in Plane for name in NUMBERS[plane]]
    + [f"{plane} {name} at crossover" for plane in Plane for name in ("gain", "phase")]
)
"""Quantities in the order of a trial's errors."""
QUANTILE = 1.96


def scalings_of(case: Case, size: float = 1.0) -> tuple[TestScaling, TestScaling]:
    """Return the scaling of rudder and elevator tests; ``size`` is relative to a sound campaign."""
    yaw, pitch = (size * case.scale(plane) for plane in Plane)
    return TestScaling(yaw, yaw), TestScaling(pitch, pitch)


class Truth(NamedTuple):
    """True small-signal behaviour of a plant."""

    numbers: dict[str, float]
    """By label, without those at crossover."""
    crossover_radps: dict[Plane, float]
    response: dict[Plane, complex]
    """Command to measured rate at crossover."""


def case_of(plant: str) -> Case:
    """Return prior file, first gains and test sizes of a plant."""
    return vehicles.case(PRIORS[plant])


def truth(plant: Plant, case: Case) -> Truth:
    """Return the true numbers of a plant in the loops of its first dive."""
    numbers = dict[str, float]()
    frequencies, responses = dict[Plane, float](), dict[Plane, complex]()
    for plane in Plane:
        yaw = PLANES[plane].is_yaw

        def response(omega_radps: float, plane: Plane = plane) -> complex:
            yaw = PLANES[plane].is_yaw
            axis = plant.rudder if yaw else plant.elevator
            return complex(
                small_signal.response(
                    plant.body,
                    plant.trim,
                    axis,
                    plant.sensors.gyro_lag_s,
                    yaw,
                    np.array([omega_radps]),
                )[0]
            )

        hold = case.hold
        gains = (hold.heading_p, hold.heading_d) if yaw else (hold.pitch_p, hold.pitch_d)
        frequencies[plane] = _crossover_radps(response, *gains)
        responses[plane] = response(frequencies[plane])
        values = small_signal.numbers(plant.body, plant.trim, yaw)._asdict()
        numbers |= {f"{plane} {name}": values[name] for name in NUMBERS[plane] if name in values}
    return Truth(numbers, frequencies, responses)


def delay_s(
    plant: Plant, plane: Plane, model: IdentifiedModel, case: Case, omega_radps: float
) -> float:
    """Return the delay that, behind the identified lag, gives the true phase of the surface."""
    axis = plant.rudder if PLANES[plane].is_yaw else plant.elevator
    actuator = prediction.vehicles(model, case.prior)[0].actuators[plane]
    lag = actuator.natural_frequency_radps, actuator.damping_ratio
    return small_signal.equivalent_delay_s(axis, plant.sensors.gyro_lag_s, lag, omega_radps)


def _crossover_radps(response: Callable[[float], complex], p: float, d: float) -> float:
    """Return the last frequency at which the loop (p / s + d) G has a gain of one."""

    def excess(log_omega: float) -> float:
        omega = math.exp(log_omega)
        return math.log(abs((p / (1j * omega) + d) * response(omega)))

    grid = np.linspace(math.log(0.05), math.log(20.0), 200)
    above = [k for k, x in enumerate(grid) if excess(float(x)) > 0.0]
    return math.exp(float(brentq(excess, grid[above[-1]], grid[above[-1] + 1])))


def errors(model: IdentifiedModel, case: Case, plant: Plant) -> tuple[Array, Array]:
    """Return error and standard deviation of each of LABELS; dB and deg at crossover."""
    true = truth(plant, case)
    wrong, sds = [], []
    for plane in Plane:
        values = true.numbers | {
            f"{plane} delay_s": delay_s(plant, plane, model, case, true.crossover_radps[plane])
        }
        for name in NUMBERS[plane]:
            estimate = getattr(model.planes[plane], name)
            wrong.append(estimate.value - values[f"{plane} {name}"])
            sds.append(math.nan if estimate.sd is None else estimate.sd)
    for plane in Plane:

        def quantities(z: Array, plane: Plane = plane) -> Array:
            vehicle = prediction.perturb(model, z, case.prior)
            found = model_crossover.response(vehicle, plane, true.crossover_radps[plane])
            ratio = np.log(found / true.response[plane])
            return np.array([20.0 / math.log(10.0) * ratio.real, math.degrees(ratio.imag)])

        z, covariance = np.array(model.joint.z), np.array(model.joint.covariance)
        wrong += quantities(z).tolist()
        sds += delta_method.propagate_sd(delta_method.slopes(quantities, z), covariance).tolist()
    return np.array(wrong), np.array(sds)


class Conditions(NamedTuple):
    """Conditions of a campaign; the defaults are sound."""

    level: float = 1.0
    """Size of the disturbance."""
    grip: float = 1.0
    """Share of the deflection that a slipping coupling leaves, see ``flight.dive``."""
    size: float = 1.0
    """Ratio of the tests to those of a sound campaign."""
    prior_of: str = ""
    """Plant whose vehicle file is the prior; empty for the plant's own."""


SOUND = Conditions()
"""Conditions of the study of coverage."""


@lru_cache(maxsize=1)  # the cells outside and verdicts evaluate the same model one after the other
def identified(name: str, seed: int, conditions: Conditions) -> IdentifiedModel:
    """Fly and record a campaign of a plant, and identify it."""
    case = case_of(name)
    with tempfile.TemporaryDirectory() as folder:
        fitted, held_out = logs.campaign(
            Path(folder),
            catalogue.plant(name, seed),
            scalings=scalings_of(case, conditions.size),
            gains=Gains(*case.hold),
            seed=seed,
            level=conditions.level,
            grip=conditions.grip,
        )
        prior_file = case_of(conditions.prior_of or name).prior_file
        return refit.refit(refit.RefitRequest(paths=fitted, held_out=held_out, prior=prior_file))


def trial(name: str, seed: int) -> list[float]:
    """Return errors, standard deviations, whether the model passed, and CPU seconds.

    The numbers of a refused campaign are unknown (NaN).
    """
    began_s = process_time()
    try:
        model = identified(name, seed, SOUND)
    except CaribouError:
        return [math.nan] * (2 * len(LABELS)) + [0.0, process_time() - began_s]
    spent_s = process_time() - began_s
    wrong, sds = errors(model, case_of(name), catalogue.plant(name, seed))
    passed = model.assessment is not None and model.assessment.fit_for_redesign
    return [*wrong.tolist(), *sds.tolist(), float(passed), spent_s]


def judge(name: str, rows: Array) -> list[Figure]:
    """Return the figures of `accuracy`, the share of models that pass, and the time of a refit."""
    return [
        *accuracy(rows),
        Figure("models that pass", 100.0 * float(np.mean(rows[:, -2])), unit="%"),
        Figure("CPU time of a refit, median", float(np.median(rows[:, -1])), unit="s"),
    ]


def accuracy(rows: Array) -> list[Figure]:
    """Return coverage, errors at crossover, and width of the intervals over the scatter.

    A row begins with the errors and the standard deviations of LABELS.
    """
    count = len(LABELS)
    wrong, sds = rows[:, :count], rows[:, count : 2 * count]
    known = np.isfinite(sds) & (sds > 0.0)
    inside = np.where(known, np.abs(wrong) <= QUANTILE * sds, np.nan)
    ratio = _rms(np.where(known, sds, np.nan)) / _rms(np.where(known, wrong, np.nan))
    numbers, at_crossover = slice(0, count - 4), slice(count - 4, count)
    figures = [
        Figure("all numbers in their 95 % intervals", _percent(inside), 90.0, 98.0, "%"),
        Figure("design numbers", _percent(inside[:, numbers]), 90.0, 98.0, "%"),
        Figure("gain and phase at crossover", _percent(inside[:, at_crossover]), 90.0, 98.0, "%"),
        Figure(
            "width of the intervals over 1.96 rms error, geometric mean",
            float(np.exp(np.nanmean(np.log(ratio)))),
            highest=1.5,
        ),
    ]
    for plane, column in zip(Plane, (count - 4, count - 2), strict=True):
        gain, phase = _rms(wrong[:, column : column + 2])
        figures += [
            Figure(f"{plane}: gain at crossover, rms", float(gain), highest=0.3, unit="dB"),
            Figure(f"{plane}: phase at crossover, rms", float(phase), highest=2.0, unit="deg"),
        ]
    figures += [
        Figure(f"{label}: in its interval", _percent(inside[:, column]), unit="%")
        for column, label in enumerate(LABELS)
    ]
    figures += [
        Figure(f"{label}: width over scatter", float(ratio[column]))
        for column, label in enumerate(LABELS)
    ]
    return figures


def _rms(values: Array) -> Array:
    """Return the root mean square over the trials."""
    return np.asarray(np.sqrt(np.nanmean(values**2, axis=0)))


def _percent(inside: Array) -> float:
    """Return the percentage of ones among the known entries."""
    return 100.0 * float(np.nanmean(inside))


OUTSIDE = Cell(
    "outside",
    "plants that share no code with the simulator",
    trial,
    judge,
    runs=20,
    cases=tuple(PRIORS),
    campaigns="outside",
)
"""Headline of the study: coverage and errors on plants from outside."""
