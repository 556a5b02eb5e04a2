"""Cell: the nonlinear estimate on nonlinear vehicles, and its prediction of other tests.

A trial is one campaign in the disturbed sea: the supplied missions' steps and sweeps, each scaled
to the vehicle and ended where the autopilot's safety limits would end it. The fitted model then
predicts, open loop, new steps and a signal of a kind that was not fitted. These are simulated in
still water with perfect sensors, so that the error is the model's only.
"""

import math
from functools import lru_cache
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import crossover, vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.study import Cell, Figure
from sysid import prior_knowledge
from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.map import fit, steady_state
from sysid.estimation.map.convergence import START_COST_TOLERANCE
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.models import linear_planes, model_export, parameters, prediction
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import PLANES, Plane
from tests.sysid import sea

Array = NDArray[np.float64]

ENVELOPE_RAD = {Plane.YAW: math.radians(180.0), Plane.PITCH: math.radians(35.0)}
"""Change of heading and pitch at which the autopilot ends a test (SID_HDG_MAX, SID_PITCH_MAX)."""
SHORTEST_S = 5.0
"""Least length of a test that is ended early."""
FITTED: dict[Plane, tuple[tuple[str, float, float], ...]] = {
    Plane.YAW: (
        ("step", 3.0, 20.0),
        ("step", -3.0, 20.0),
        ("step", 5.0, 20.0),
        ("step", -5.0, 20.0),
        ("step", 7.0, 20.0),
        ("step", -7.0, 20.0),
        ("step", 9.0, 20.0),
        ("step", -12.0, 20.0),
        ("chirp", 4.0, 28.0),
        ("chirp", 7.0, 28.0),
        ("doublet", 5.0, 24.0),
        ("doublet", -5.0, 24.0),
    ),
    Plane.PITCH: (
        ("step", 2.0, 8.0),
        ("step", 3.0, 8.0),
        ("step", 4.0, 8.0),
        ("step", 5.0, 8.0),
        ("step", 7.0, 8.0),
        ("step", 9.0, 8.0),
        ("step", 12.0, 6.0),
        ("step", 14.0, 6.0),
        ("chirp", 3.0, 25.0),
        ("chirp", 5.0, 25.0),
        ("doublet", 4.0, 10.0),
        ("doublet", 6.0, 8.0),
    ),
}
"""Signal, degrees for Caribou, seconds: ground/missions/{rudder,elevator}_{steps,sweeps}.toml."""
CHIRP_HZ = {Plane.YAW: (0.06, 0.35), Plane.PITCH: (0.08, 0.4)}
FRESH: dict[Plane, tuple[tuple[str, float, float], ...]] = {
    Plane.YAW: (("step", -4.0, 20.0), ("step", 6.0, 20.0), ("step", -8.0, 20.0)),
    Plane.PITCH: (("step", 2.5, 8.0), ("step", 4.5, 8.0), ("step", 8.0, 8.0)),
}
UNSHOWN: dict[Plane, tuple[tuple[str, float, float], ...]] = {
    Plane.YAW: (("3211", 6.0, 17.5), ("3211", -4.0, 10.5)),
    Plane.PITCH: (("3211", 4.0, 10.5), ("3211", 3.0, 17.5)),
}
LEAST_FACTOR = {Plane.YAW: 10.0, Plane.PITCH: 20.0}
"""Target for new steps: mean squared error of the prior over that of the fitted model."""
LEAST_UNSHOWN = 4.0
"""The same for the signal that was not fitted."""
DESIGN = ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s", "delay_s")


class Campaign(NamedTuple):
    """Fit of one campaign."""

    case: Case
    prior: Prior
    found: Fit
    seconds: float


def flown(case: Case, seed: int) -> list[Run]:
    """Simulate the tests of one campaign."""
    return [
        flown_test(case, plane, test, 1000 * seed + 100 * PLANES[plane].index + number)
        for plane in Plane
        for number, test in enumerate(FITTED[plane])
    ]


def flown_test(case: Case, plane: Plane, test: tuple[str, float, float], seed: int) -> Run:
    """Simulate one test in the disturbed sea."""
    return within(_fly(case, plane, test, seed, calm=False))


@lru_cache(maxsize=1)  # the cells prediction and judging evaluate the same fit one after the other
def campaign(vehicle: str, seed: int) -> Campaign:
    """Simulate a campaign and fit it."""
    case = vehicles.case(vehicle)
    runs = flown(case, seed)
    prior = prior_knowledge.prior_of(runs, case.prior)
    began_s = perf_counter()
    found = fit.fit(runs, prior)
    return Campaign(case, prior, found, perf_counter() - began_s)


def _fly(case: Case, plane: Plane, test: tuple[str, float, float], seed: int, calm: bool) -> Run:
    """Simulate one test; ``calm`` means still water and perfect sensors."""
    level, sensors = (sea.CALM, sea.Sensors(0.0, 0.0, 0.0, 0.0)) if calm else (sea.ROUGH, None)
    return sea.fly(
        case.truth,
        plane,
        _signal(plane, test, case.scale(plane)),
        seed=seed,
        level=level,
        sensors=sensors,
        trim_rad=case.trim_rad,
        hold=case.hold,
    )


def _signal(plane: Plane, test: tuple[str, float, float], scale: float) -> Array:
    """Return the signal of a test (rad), scaled to the vehicle."""
    kind, degrees, seconds = test
    degrees *= scale
    if kind == "step":
        return sea.step(degrees, seconds)
    if kind == "doublet":
        return sea.doublet(degrees, seconds / 2.0)
    if kind == "3211":
        unit_s = seconds / 7.0
        return np.concatenate(
            [sea.step(degrees * sign, n * unit_s) for n, sign in ((3, 1), (2, -1), (1, 1), (1, -1))]
        )
    time_s, (low, high) = np.arange(int(seconds * RATE_HZ)) / RATE_HZ, CHIRP_HZ[plane]
    growth = math.log(high / low) / seconds
    return np.asarray(
        math.radians(degrees) * np.sin(2.0 * math.pi * low * np.expm1(growth * time_s) / growth)
    )


def within(run: Run) -> Run:
    """Cut the run where the safety limits would have ended it."""
    angle, limit = (
        (run.heading_rad, ENVELOPE_RAD[Plane.YAW]),
        (run.pitch_rad, ENVELOPE_RAD[Plane.PITCH]),
    )
    started = int(np.searchsorted(run.time_s, 0.0))
    beyond = np.zeros(run.time_s.size, dtype=bool)
    for values, most in (angle, limit):
        beyond |= np.abs(values - values[started]) > most
    beyond[: started + int(SHORTEST_S * RATE_HZ)] = False
    return run.until(float(run.time_s[int(np.argmax(beyond))])) if beyond.any() else run


def factor(campaign: Campaign, plane: Plane, tests: tuple[tuple[str, float, float], ...]) -> float:
    """Return the mean squared rate error of the prior over that of the fitted vehicle."""
    first = parameters.candidate_vehicle(
        campaign.prior.config, campaign.prior.biases_rad, np.zeros(len(NAMES))
    )
    runs = [
        within(_fly(campaign.case, plane, test, 0, calm=True)).since(-prediction.LEAD_S)
        for test in tests
    ]
    before, after = (
        sum(_error(vehicle, run) for run in runs) for vehicle in (first, campaign.found.vehicle)
    )
    return before / after


def _error(vehicle: CandidateVehicle, run: Run) -> float:
    """Return the mean squared rate error of a vehicle's prediction of a run."""
    error = run.rate_radps - prediction.simulate(vehicle, run).rate_radps
    return float(np.mean(error[~run.preroll] ** 2))


def covered(campaign: Campaign) -> list[float]:
    """Return 1.0 per design parameter whose 95 % interval contains the true value, else 0.0.

    NaN for a number without an interval.
    """
    model = model_export.from_fit(campaign.found, campaign.prior, campaign.case.name)
    held = []
    for plane in Plane:
        true = linear_planes.small_signal(
            steady_state.linear_plane(vehicles.nominal(campaign.case.truth), plane)
        )
        values = {**true._asdict(), "delay_s": campaign.case.truth.tailcone.delay_s}
        for name in DESIGN:
            estimate = getattr(model.planes[plane], name)
            error, sd = abs(estimate.value - values[name]), estimate.sd
            held.append(math.nan if sd is None else float(error <= 1.96 * sd))
    return held


def trial(vehicle: str, seed: int) -> list[float]:
    """Return factors (4), crossover errors (4: dB, deg per plane), coverage (10), converged, s."""
    done = campaign(vehicle, seed)
    factors = [factor(done, plane, tests[plane]) for tests in (FRESH, UNSHOWN) for plane in Plane]
    errors = [
        value for plane in Plane for value in crossover.errors(done.case, done.found.vehicle, plane)
    ]
    agreed = all(
        abs(cost - done.found.cost) <= START_COST_TOLERANCE * done.found.cost
        for cost in done.found.start_costs
    )
    return [
        *factors,
        *errors,
        *covered(done),
        float(agreed and not done.found.at_bounds),
        done.seconds,
    ]


def judge(vehicle: str, rows: Array) -> list[Figure]:
    """Return prediction, crossover, coverage and convergence figures."""
    figures = []
    names = [
        f"{plane}, {kind}" for kind in ("fresh steps", "3-2-1-1, not fitted") for plane in Plane
    ]
    least = [LEAST_FACTOR[Plane.YAW], LEAST_FACTOR[Plane.PITCH], LEAST_UNSHOWN, LEAST_UNSHOWN]
    for column, (name, wanted) in enumerate(zip(names, least, strict=True)):
        factors = rows[:, column]
        figures.append(
            Figure(f"{name}: error, prior over refitted", _geometric_mean(factors), lowest=wanted)
        )
        figures.append(
            Figure(
                f"{name}: campaigns that reach the target",
                100.0 * float(np.mean(factors >= wanted)),
                unit="%",
            )
        )
    for column, plane in ((4, Plane.YAW), (6, Plane.PITCH)):
        gain, phase = (float(np.sqrt(np.mean(rows[:, column + k] ** 2))) for k in (0, 1))
        bias = np.mean(rows[:, column : column + 2], axis=0)
        figures.append(Figure(f"{plane}: gain at crossover, rms", gain, highest=0.3, unit="dB"))
        figures.append(Figure(f"{plane}: phase at crossover, rms", phase, highest=3.0, unit="deg"))
        figures.append(Figure(f"{plane}: gain at crossover, mean", float(bias[0]), unit="dB"))
        figures.append(Figure(f"{plane}: phase at crossover, mean", float(bias[1]), unit="deg"))
    for column, name in enumerate(f"{plane} {number}" for plane in Plane for number in DESIGN):
        figures.append(
            Figure(
                f"{name}: in its 95 % interval",
                100.0 * float(np.nanmean(rows[:, 8 + column])),
                unit="%",
            )
        )
    figures.append(
        Figure(
            "design numbers in their 95 % intervals",
            100.0 * float(np.nanmean(rows[:, 8:18])),
            90.0,
            unit="%",
        )
    )
    figures.append(
        Figure("converged from all starts", 100.0 * float(np.mean(rows[:, 18])), 99.0, unit="%")
    )
    figures.append(Figure("fit with eight further starts", float(np.median(rows[:, 19])), unit="s"))
    return figures


def _geometric_mean(values: Array) -> float:
    return float(np.exp(np.mean(np.log(values))))


PREDICTION = Cell(
    "prediction",
    "prediction of held-out tests by the nonlinear estimate",
    trial,
    judge,
    campaigns="prediction",
)
