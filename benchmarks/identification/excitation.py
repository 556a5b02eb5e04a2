"""Cell: phase accuracy at crossover after designed tests, compared with the paper's steps.

Both sets have the same test time; tests are designed once per vehicle (``designed``), and the
paper's steps are scaled to the vehicle. The predicted accuracy is the Cramer-Rao bound for the
linearised true vehicle in coloured disturbances. The measured accuracy comes from campaigns in the
nonlinear disturbed sea: both sets are simulated and fitted by the nonlinear estimator from the same
prior, and the phase at crossover is compared with the true vehicle's.
"""

import cmath
import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import crossover, designed, prediction, vehicles
from benchmarks.identification.vehicles import Case
from benchmarks.study import Cell, Figure
from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.linear import cramer_rao
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.planes import Plane
from sysid.test_design import closed_loop, simulate
from sysid.test_design.safety_margins import ExcursionLimits
from sysid.test_design.simulate import Manoeuvre
from sysid.validation.crossover import highest_feasible_radps
from tests.sysid import sea

Array = NDArray[np.float64]

SEA = Noise(
    rate_radps=sea.Sensors().rate_radps,
    angle_rad=sea.Sensors().angle_rad,
    depth_m=sea.Sensors().depth_m,
    slow_radps2=sea.SLOW_RADPS2,
    wave_radps2=sea.WAVE_RADPS2,
)
"""Disturbances of the tests' sea in the form of the noise model."""
MAX_GROWTH = 1e6
"""Growth of an unstable plane that leaves its sensitivities ten digits."""
LEAST_RATIO = 5.0
"""Target: phase standard deviation after the paper's steps over that after designed tests."""
LEAST_WITHIN_PCT = 99.0
"""Target: fraction of designed tests that stay within the safety limits."""


def attainable_radps(case: Case, plane: Plane) -> float:
    """Return the highest crossover frequency that the vehicle file allows for a redesign."""
    return highest_feasible_radps(vehicles.nominal(case.prior), plane)


@cache
def predicted_deg(vehicle: str) -> tuple[float, ...]:
    """Return bounds on the phase error's sd: paper's and designed tests in yaw, then in pitch."""
    case = vehicles.case(vehicle)
    both = designed.sets(vehicle)
    return tuple(
        _predicted_deg(case, flown, plane)
        for plane in Plane
        for flown in (both.paper, both.designed)
    )


def _predicted_deg(case: Case, flown: tuple[Manoeuvre, ...], plane: Plane) -> float:
    """Return the Cramer-Rao bound on the phase at crossover.

    sd = sqrt(g^T P g) with the bound P on the parameter covariance and the gradient g of the phase
    by central differences.
    """
    truth = plants.of_vehicle(vehicles.nominal(case.truth), plane)
    commands = [_command(case, half) for m in flown for half in m.halves if half.plane == plane]
    least = cramer_rao.bound_coloured(
        truth, [piece for command in commands for piece in _pieces(truth, command)], SEA
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


def _pieces(truth: LinearModel, command: SurfaceCommand) -> list[SurfaceCommand]:
    """Cut a command into pieces during which the plane grows by at most `MAX_GROWTH`.

    The Cramer-Rao bound is computed without the loop. Over a whole test that only a loop makes
    possible, the sensitivities of an unstable plane would lose all digits.
    """
    growth_per_s = float(np.max(np.linalg.eigvals(plants.linear_plane(truth).A).real))
    angle_rad, lead = command.angle_rad, int(simulate.LEAD_S * RATE_HZ)
    if growth_per_s * angle_rad.size / RATE_HZ <= math.log(MAX_GROWTH):
        return [command]
    length = int(math.log(MAX_GROWTH) / growth_per_s * RATE_HZ)
    starts = range(0, angle_rad.size - lead - 1, length)
    return [SurfaceCommand(angle_rad[start : start + lead + length], lead) for start in starts]


def _response(truth: LinearModel, values: Array, omega_radps: float) -> complex:
    """Return the response of the rate to the command for these parameter values."""
    moved = truth._replace(values=values)
    linear, actuator = plants.linear_plane(moved), plants.actuator(moved)
    s, wn = 1j * omega_radps, actuator.natural_frequency_radps
    rate = np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, linear.B)[1]
    lag = wn**2 / (s**2 + 2.0 * actuator.damping_ratio * wn * s + wn**2)
    return complex(rate * lag * cmath.exp(-s * actuator.delay_s))


def _command(case: Case, what: Manoeuvre) -> SurfaceCommand:
    """Return the command in still water, as the true vehicle's loops produce it."""
    signal = simulate.signal_rad(what)
    if what.loop_on:
        held = closed_loop.of_vehicle(
            vehicles.nominal(case.truth), what.plane, designed.gains(case), SEA
        )
        signal = closed_loop.simulate(held, what.plane, signal).command_rad
    return SurfaceCommand(np.concatenate([np.zeros(int(simulate.LEAD_S * RATE_HZ)), signal]))


def stays_within(run: Run, limits: ExcursionLimits) -> bool:
    """Return whether the safety limits of the design let the test run to its end."""
    flown = run.since(0.0)
    if run.plane == Plane.YAW:
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
    """Return phase errors (deg; paper's and designed tests, yaw then pitch) and further numbers.

    The latter are the fraction of designed tests within limits and the four predicted values.
    """
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
    errors_deg = [errors[0][0], errors[1][0], errors[0][1], errors[1][1]]
    return [*errors_deg, within, *predicted_deg(vehicle)]


def _phase_errors_deg(case: Case, runs: list[Run]) -> list[float]:
    """Fit the runs and return the phase errors of both planes."""
    found = designed.fitted(case, runs)[1].vehicle
    return [_phase_error_deg(case, found, plane) for plane in Plane]


def _phase_error_deg(case: Case, found: CandidateVehicle, plane: Plane) -> float:
    """Return the phase error of a model at the attainable crossover."""
    truth = vehicles.nominal(case.truth)
    return crossover.errors_at(found, truth, plane, attainable_radps(case, plane))[1]


def judge(vehicle: str, rows: Array) -> list[Figure]:
    """Return predicted and measured phase errors and their ratios."""
    figures = []
    predicted = rows[0, 5:]
    for number, plane in enumerate(Plane):
        steps_deg, designed_deg = predicted[2 * number : 2 * number + 2]
        figures.append(
            Figure(
                f"{plane}: phase at crossover predicted, paper's steps",
                float(steps_deg),
                unit="deg",
            )
        )
        figures.append(
            Figure(
                f"{plane}: phase at crossover predicted, designed", float(designed_deg), unit="deg"
            )
        )
        figures.append(
            Figure(
                f"{plane}: predicted, steps over designed",
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
    "designed tests compared with the paper's steps of equal test time",
    trial,
    judge,
    runs=40,
)
