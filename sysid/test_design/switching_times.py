"""Square waves whose switch times are chosen for what is still unknown: differential evolution with
a fixed budget.

The autopilot takes a square wave as up to fourteen runs of one to nine parts each, up and down by
turns; the search is over those digits, so that what is designed is what can be flown. While it
searches, a wave is the sum of the steps that it is made of: what is told and how far the vehicle
goes are those of one step, shifted and added. What it finds is then sized and judged like every
other candidate."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from sysid.control_analysis.loop_transfer import Gains
from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.map import fit
from sysid.test_design import information, safety_margins
from sysid.test_design.prior import DesignPrior
from sysid.test_design.safety_margins import ExcursionLimits, VehicleSample
from sysid.test_design.simulate import Manoeuvre

Array = NDArray[np.float64]

MAX_SWITCHES = 14
GENERATIONS, POPULATION = 12, 3
"""Of the search; a generation has POPULATION candidates for every run."""
N_SAMPLES = 16
"""Samples by which the search judges how large a wave may be; the final size rests on all of
them."""
STEP_HZ = RATE_HZ / fit.STRIDE


class UnitStepResponse(NamedTuple):
    """What a step of one degree does that begins with the test."""

    told: Array
    """(steps, outputs, n): ``information.sensitivities`` from the test's start on."""
    answers: Array
    """(scouts, steps, 3)."""
    rests: Array
    """(scouts, 3): the farthest that each goes without a test."""


def design_square_wave(
    belief: DesignPrior,
    shape: Manoeuvre,
    gains: Gains,
    largest_deg: float,
    samples: Sequence[VehicleSample],
    limits: ExcursionLimits,
    left: Callable[[Array], float],
    known: Array,
    seed: int,
    shortest_s: float,
) -> Manoeuvre:
    """The square wave of ``shape``'s plane, loop and length that, at the size that limits allow,
    leaves least unknown beside the information ``known``; a mean run is no shorter than
    ``shortest_s``."""
    count = int(np.clip(shape.duration_s / shortest_s, 3, MAX_SWITCHES))
    step = _steps(belief, shape, gains, samples[:N_SAMPLES])
    most = _limits_of(limits, shape.plane)

    def badness(digits: Array) -> float:
        switches = switch_steps(digits, shape.duration_s)
        size_deg = min(largest_deg, _max_size(step, switches, most))
        flat = (size_deg * superpose(step.told, switches, 0)).reshape(-1, step.told.shape[2])
        return left(known + flat.T @ flat)

    found = differential_evolution(
        badness,
        [(1.0, 9.0)] * count,
        integrality=[True] * count,
        maxiter=GENERATIONS,
        popsize=POPULATION,
        rng=seed,
        polish=False,
        tol=0.0,
    )
    return shape._replace(wave="square", runs=tuple(int(digit) for digit in np.round(found.x)))


def switch_steps(digits: Array, duration_s: float) -> NDArray[np.int64]:
    """When a wave of these runs switches, in steps of 10 Hz from its start."""
    ends = np.cumsum(np.round(digits))
    return np.asarray(np.round(ends[:-1] / ends[-1] * duration_s * STEP_HZ), dtype=np.int64)


def _steps(
    belief: DesignPrior, shape: Manoeuvre, gains: Gains, scouts: Sequence[VehicleSample]
) -> UnitStepResponse:
    """Taken at the shape's nominal size, where the answer is as large as it will be."""
    step = shape._replace(wave="step")
    (told,) = information.sensitivities(belief, [step], gains)
    pairs = safety_margins.responses(step, scouts)
    return UnitStepResponse(
        told[-int(shape.duration_s * STEP_HZ) - 1 :] / shape.size_deg,
        np.array([answer for answer, _ in pairs]) / shape.size_deg,
        np.array([np.max(np.abs(rest), axis=0) for _, rest in pairs]),
    )


def superpose(step: Array, switches: NDArray[np.int64], axis: int) -> Array:
    """Up at the start, down by twice as much at the first switch, up again at the next."""
    total = step.copy()
    moved = np.moveaxis(total, axis, 0)
    source = np.moveaxis(step, axis, 0)
    for number, at in enumerate(switches):
        moved[at:] += (2.0 if number % 2 else -2.0) * source[: len(source) - at]
    return total


def _limits_of(limits: ExcursionLimits, plane: Plane) -> Array:
    if plane == "yaw":
        return np.array([limits.yaw_rate_radps, limits.heading_rad, math.inf])
    return np.array([limits.pitch_rate_radps, limits.pitch_rad, min(limits.up_m, limits.down_m)])


def _max_size(step: UnitStepResponse, switches: NDArray[np.int64], most: Array) -> float:
    """Size in degrees with which nearly all scouts stay within, their sea at its worst when their
    answer is."""
    peaks = np.max(np.abs(superpose(step.answers, switches, 1)), axis=1)
    sizes = np.min((most - step.rests) / np.maximum(peaks, 1e-12), axis=1)
    return max(safety_margins.MIN_SIZE_DEG, float(np.quantile(sizes, 0.1)))
