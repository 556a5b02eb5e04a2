"""What designed tests tell of the crossover beside the paper's steps of equal water time.

Designs are made once per vehicle (``designed``); the paper's steps, sized to the vehicle, get as
much water. Foretold is the Cramer-Rao bound of either set on the small-signal truth in the coloured
sea. Measured is a campaign in the nonlinear disturbed sea: both sets flown, both fitted by the
joint estimator from the same prior, and how far the crossover's phase then is from the true
vehicle's."""

import cmath
import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import crossover, designed, prediction, vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.study import Cell, Figure
from sysid.data.segments import RATE_HZ, Plane, Run
from sysid.estimation.linear import cramer_rao
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.test_design import closed_loop, simulate
from sysid.test_design import crossover as reach
from sysid.test_design.information import PLANES
from sysid.test_design.safety_margins import ExcursionLimits
from sysid.test_design.simulate import Manoeuvre
from tests.sysid import sea

Array = NDArray[np.float64]

SEA = Noise(
    rate_radps=sea.Sensors().rate_radps,
    angle_rad=sea.Sensors().angle_rad,
    depth_m=sea.Sensors().depth_m,
    slow_radps2=sea.SLOW_RADPS2,
    wave_radps2=sea.WAVE_RADPS2,
)
"""Of the tests' sea, as the noise model has it."""
LEAST_RATIO = 5.0
LEAST_WITHIN_PCT = 99.0


def attainable_radps(case: Case, plane: Plane) -> float:
    """The crossover at which a redesign may aim: the highest that her file allows."""
    return reach.frequency_radps(vehicles.nominal(case.prior), plane)


@cache
def foretold_deg(vehicle: str) -> tuple[float, ...]:
    """Standard deviations of the phase at the crossover that no unbiased estimator can better:
    paper's, designed tests' in yaw, then in pitch."""
    case = vehicles.case(vehicle)
    both = designed.sets(vehicle)
    return tuple(
        _foretold_deg(case, flown, plane)
        for plane in PLANES
        for flown in (both.paper, both.designed)
    )


def _foretold_deg(case: Case, flown: tuple[Manoeuvre, ...], plane: Plane) -> float:
    truth = plants.of_vehicle(vehicles.nominal(case.truth), plane)
    least = cramer_rao.bound_coloured(
        truth,
        [_command(case, half) for m in flown for half in m.halves if half.plane == plane],
        SEA,
    )
    omega = attainable_radps(case, plane)
    steps = 1e-5 * np.maximum(np.abs(truth.values), 1e-2)
    ahead, behind = (
        [_response(truth, truth.values + h, omega) for h in np.diag(sign * steps)]
        for sign in (1.0, -1.0)
    )
    slope = np.array([cmath.phase(a / b) for a, b in zip(ahead, behind, strict=True)]) / (
        2.0 * steps
    )
    return math.degrees(math.sqrt(slope @ least.covariance @ slope))


def _response(truth: LinearModel, values: Array, omega_radps: float) -> complex:
    """Rate over command of a plant with these values."""
    moved = truth._replace(values=values)
    linear, actuator = plants.linear_plane(moved), plants.actuator(moved)
    s, wn = 1j * omega_radps, actuator.natural_frequency_radps
    rate = np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, linear.B)[1]
    lag = wn**2 / (s**2 + 2.0 * actuator.damping_ratio * wn * s + wn**2)
    return complex(rate * lag * cmath.exp(-s * actuator.delay_s))


def _command(case: Case, what: Manoeuvre) -> SurfaceCommand:
    """As the true vehicle's loop answers it in still water."""
    signal = simulate.signal_rad(what)
    if what.loop_on:
        held = closed_loop.of_vehicle(
            vehicles.nominal(case.truth), what.plane, designed.gains(case), SEA
        )
        signal = closed_loop.simulate(held, what.plane, signal).command_rad
    return SurfaceCommand(np.concatenate([np.zeros(int(simulate.LEAD_S * RATE_HZ)), signal]))


def stays_within(run: Run, limits: ExcursionLimits) -> bool:
    """Whether the envelope that goes with the design would let the test run to its end."""
    flown = run.since(0.0)
    if run.plane == "yaw":
        turned = np.max(np.abs(flown.heading_rad - flown.heading_rad[0]))
        return bool(
            turned <= limits.heading_rad and np.max(np.abs(flown.r_radps)) <= limits.yaw_rate_radps
        )
    sunk = flown.depth_m - flown.depth_m[0]
    steep, fast = np.max(np.abs(flown.pitch_rad)), np.max(np.abs(flown.q_radps))
    return bool(
        steep <= limits.pitch_rad
        and fast <= limits.pitch_rate_radps
        and -limits.up_m <= np.min(sunk)
        and np.max(sunk) <= limits.down_m
    )


def trial(vehicle: str, seed: int) -> list[float]:
    """Phase errors (deg) after the paper's and after the designed tests in yaw, then in pitch; the
    share of designed tests that stayed within limits; and what was foretold (4)."""
    case, (ours, paper) = vehicles.case(vehicle), designed.sets(vehicle)
    runs = [
        run for number, m in enumerate(ours) for run in designed.fly(case, m, 1000 * seed + number)
    ]
    steps = [
        prediction.within(run)
        for number, m in enumerate(paper)
        for run in designed.fly(case, m, 1000 * seed + 500 + number)
    ]
    errors = [_phase_errors_deg(case, flown) for flown in (steps, runs)]
    within = float(np.mean([stays_within(run, ExcursionLimits()) for run in runs]))
    return [errors[0][0], errors[1][0], errors[0][1], errors[1][1], within, *foretold_deg(vehicle)]


def _phase_errors_deg(case: Case, runs: list[Run]) -> list[float]:
    found = designed.fitted(case, runs)[1].vehicle
    return [_phase_error_deg(case, found, plane) for plane in PLANES]


def _phase_error_deg(case: Case, found: CandidateVehicle, plane: Plane) -> float:
    omega, true = attainable_radps(case, plane), vehicles.nominal(case.truth)
    ratio = crossover.response(found, plane, omega) / crossover.response(true, plane, omega)
    return math.degrees(cmath.phase(ratio))


def judge(vehicle: str, rows: Array) -> list[Figure]:
    figures = []
    foretold = rows[0, 5:]
    for number, plane in enumerate(PLANES):
        steps_deg, designed_deg = foretold[2 * number : 2 * number + 2]
        figures.append(
            Figure(
                f"{plane}: phase at crossover foretold, paper's steps", float(steps_deg), unit="deg"
            )
        )
        figures.append(
            Figure(
                f"{plane}: phase at crossover foretold, designed", float(designed_deg), unit="deg"
            )
        )
        figures.append(
            Figure(
                f"{plane}: foretold, steps over designed",
                float(steps_deg / designed_deg),
                LEAST_RATIO,
            )
        )
        errors = rows[:, 2 * number : 2 * number + 2]
        steps_rms, designed_rms = np.sqrt(np.mean(errors**2, axis=0))
        spread = np.std(errors, axis=0)
        figures.append(
            Figure(
                f"{plane}: phase error measured, paper's steps, rms", float(steps_rms), unit="deg"
            )
        )
        figures.append(
            Figure(f"{plane}: phase error measured, designed, rms", float(designed_rms), unit="deg")
        )
        figures.append(
            Figure(
                f"{plane}: measured, steps over designed",
                float(steps_rms / designed_rms),
                LEAST_RATIO,
            )
        )
        figures.append(
            Figure(
                f"{plane}: scatter about the mean, steps over designed",
                float(spread[0] / spread[1]),
            )
        )
    figures.append(
        Figure(
            "designed tests within limits",
            100.0 * float(np.mean(rows[:, 4])),
            LEAST_WITHIN_PCT,
            unit="%",
        )
    )
    return figures


EXCITATION = Cell(
    "excitation",
    "designed tests beside the paper's steps of equal water time",
    trial,
    judge,
    runs=40,
)
