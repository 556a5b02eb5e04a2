"""Design of square waves: switch times that minimise a criterion, by differential evolution.

The autopilot accepts a square wave as up to fourteen intervals of one to nine parts, alternating up
and down. The search is over these digits, so every result can be flown. During the search a wave is
the superposition of steps: sensitivities and excursions are those of one step, shifted and added.
The result is then sized and evaluated like any other candidate.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from sysid.control_analysis.loop_transfer import Gains
from sysid.data.runs import RATE_HZ
from sysid.estimation.map.datasets import STRIDE
from sysid.planes import Plane
from sysid.test_design import information, safety_margins
from sysid.test_design.prior import DesignPrior
from sysid.test_design.safety_margins import ExcursionLimits, VehicleSample
from sysid.test_design.simulate import Manoeuvre

Array = NDArray[np.float64]

MAX_SWITCHES = 14
"""Maximum number of intervals of a square wave."""
GENERATIONS, POPULATION = 12, 3
"""Number of generations, and population per interval."""
N_SAMPLES = 16
"""Number of vehicle samples in the search; the final size uses all of them."""
STEP_HZ = RATE_HZ / STRIDE
"""Sample rate of the search (Hz)."""


class UnitStepResponse(NamedTuple):
    """Response to a step of one degree at the start of the test."""

    sensitivities: Array
    """Sensitivities from the start of the test, (steps, outputs, n)."""
    motion: Array
    """Motion of each sample, (samples, steps, 3)."""
    background: Array
    """Largest motion of each sample without a test, (samples, 3)."""


class SquareWaveRequest(NamedTuple):
    """Request for a square wave."""

    prior: DesignPrior
    """Prior of the vehicle."""
    shape: Manoeuvre
    """Plane, loop and length of the test."""
    gains: Gains
    """Current gains of the loops."""
    largest_deg: float
    """Available travel (deg)."""
    samples: Sequence[VehicleSample]
    """Sampled vehicles."""
    limits: ExcursionLimits
    criterion: Callable[[Array], float]
    """Criterion of an information matrix."""
    prior_information: Array
    """Information before the test, (n, n)."""
    seed: int
    """Seed of the search."""
    shortest_s: float
    """Minimum mean interval (s)."""


def design_square_wave(request: SquareWaveRequest) -> Manoeuvre:
    """Return the square wave that minimises the criterion at its largest safe size.

    Parameters
    ----------
    request : SquareWaveRequest
        Test, vehicle, limits and criterion.

    Returns
    -------
    Manoeuvre
        The requested shape with its switch intervals.
    """
    shape = request.shape
    count = int(np.clip(shape.duration_s / request.shortest_s, 3, MAX_SWITCHES))
    step_response = _steps(request.prior, shape, request.gains, request.samples[:N_SAMPLES])
    max_motion = _limits_of(request.limits, shape.plane)

    def cost(digits: Array) -> float:
        """Return the criterion of a wave at its largest safe size."""
        switches = switch_steps(digits, shape.duration_s)
        size_deg = min(request.largest_deg, _max_size(step_response, switches, max_motion))
        jacobian = (size_deg * superpose(step_response.sensitivities, switches, 0)).reshape(
            -1, step_response.sensitivities.shape[2]
        )
        return request.criterion(request.prior_information + jacobian.T @ jacobian)

    optimum = differential_evolution(
        cost,
        [(1.0, 9.0)] * count,
        integrality=[True] * count,
        maxiter=GENERATIONS,
        popsize=POPULATION,
        rng=request.seed,
        polish=False,
        tol=0.0,
    )
    return shape._replace(wave="square", runs=tuple(int(digit) for digit in np.round(optimum.x)))


def switch_steps(digits: Array, duration_s: float) -> NDArray[np.int64]:
    """Return the switch times in samples of the 10 Hz grid from the start."""
    interval_ends = np.cumsum(np.round(digits))
    return np.asarray(
        np.round(interval_ends[:-1] / interval_ends[-1] * duration_s * STEP_HZ), dtype=np.int64
    )


def _steps(
    prior: DesignPrior, shape: Manoeuvre, gains: Gains, samples: Sequence[VehicleSample]
) -> UnitStepResponse:
    """Return the step response at the nominal size, where the response is largest."""
    step = shape._replace(wave="step")
    (sensitivities,) = information.sensitivities(prior, [step], gains)
    responses = safety_margins.responses(step, samples)
    return UnitStepResponse(
        sensitivities[-int(shape.duration_s * STEP_HZ) - 1 :] / shape.size_deg,
        np.array([motion for motion, _ in responses]) / shape.size_deg,
        np.array(
            [np.max(np.abs(motion_without_test), axis=0) for _, motion_without_test in responses]
        ),
    )


def superpose(step: Array, switches: NDArray[np.int64], axis: int) -> Array:
    """Return up at the start, down by two at the first switch, up by two at the next, and so on."""
    total = step.copy()
    shifted = np.moveaxis(total, axis, 0)
    source = np.moveaxis(step, axis, 0)
    for number, index in enumerate(switches):
        shifted[index:] += (2.0 if number % 2 else -2.0) * source[: len(source) - index]
    return total


def _limits_of(limits: ExcursionLimits, plane: Plane) -> Array:
    """Return the limits of rate, angle and depth in one plane."""
    rate, angle, up, down = limits.motion(plane)
    return np.array([rate, angle, min(up, down)])


def _max_size(step: UnitStepResponse, switches: NDArray[np.int64], max_motion: Array) -> float:
    """Return the size (deg) with which 90 % of the samples stay within the limits.

    The disturbance motion is added at its largest, as if it coincided with the peak of the
    response.
    """
    peaks = np.max(np.abs(superpose(step.motion, switches, 1)), axis=1)
    sizes = np.min((max_motion - step.background) / np.maximum(peaks, 1e-12), axis=1)
    return max(safety_margins.MIN_SIZE_DEG, float(np.quantile(sizes, 0.1)))
