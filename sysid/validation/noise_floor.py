"""How alike measured and simulated rates are, and what of their distance sea and sensors
explain."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import Run
from sysid.models import noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import Noise
from sysid.validation.results import Theil

Array = NDArray[np.float64]

SETTLING_STEPS = 400
"""Steps after which a filter of a plane knows as much as it ever will: 40 s."""


class NoiseFloor(NamedTuple):
    """Mean squared rate error of a model without fault: expectation and standard deviation,
    (deg/s)^2."""

    mean_deg2ps2: float
    sd_deg2ps2: float


def theil(measured: Array, simulated: Array) -> Theil:
    """Theil's inequality coefficient U and the shares of its numerator squared (Theil 1966, chapter
    2)."""
    error = float(np.mean((measured - simulated) ** 2))
    sizes = np.sqrt(np.mean(measured**2)) + np.sqrt(np.mean(simulated**2))
    if error == 0.0:
        return Theil(0.0, 0.0, 0.0, 0.0)
    bias = float(np.mean(measured) - np.mean(simulated)) ** 2 / error
    variance = float(np.std(measured) - np.std(simulated)) ** 2 / error
    return Theil(float(np.sqrt(error) / sizes), bias, variance, max(0.0, 1.0 - bias - variance))


def rate_covariance(plane: LinearPlane, level: Noise, dt: float, lead: int, samples: int) -> Array:
    """Covariance (samples, samples) of the rate error, (rad/s)^2, that sea and sensors alone leave
    of a test.

    A run is simulated from its measured start, ``lead`` samples before the test. The simulation
    knows nothing of the sea, so the moments that act on the plane have their stationary variances;
    its start is known as well as a settled filter knows it. Small motion is assumed: a tight turn
    damps the sea's answer, and leaves up to a third less."""
    A, density, output, sensors, start = noise.system(plane, level)
    transition, process = noise.discrete(A, density, dt)
    P = _steady_covariance(transition, process, output, sensors, start)
    moments = slice(plane.A.shape[0], plane.A.shape[0] + 3)
    P[moments, :] = P[:, moments] = 0.0
    P[moments, moments] = start[moments, moments]
    rate = output[0]
    reach = np.empty((samples, rate.size))
    reach[0] = rate
    for k in range(1, samples):
        reach[k] = reach[k - 1] @ transition
    C = np.empty((samples, samples))
    for k in range(lead + samples):
        if k >= lead:
            i = k - lead
            C[i, i:] = C[i:, i] = reach[: samples - i] @ (P @ rate)
        P = transition @ P @ transition.T + process
    C[np.diag_indices(samples)] += sensors[0, 0]
    return C


def noise_floor_of(covariance: Array) -> NoiseFloor:
    """Of the mean square over the samples of a test: for Gaussian noise its variance is 2
    sum(C_ij^2) / n^2."""
    scale = float(np.degrees(1.0)) ** 2
    sd = scale * float(np.sqrt(2.0 * np.sum(covariance**2))) / len(covariance)
    return NoiseFloor(scale * float(np.mean(np.diag(covariance))), sd)


def _steady_covariance(
    transition: Array, process: Array, output: Array, sensors: Array, P: Array
) -> Array:
    """Covariance of the states once a Kalman filter has settled, after its last measurement."""
    for _ in range(SETTLING_STEPS):
        P = transition @ P @ transition.T + process
        gain = np.linalg.solve(output @ P @ output.T + sensors, output @ P).T
        P = P - gain @ output @ P
        P = 0.5 * (P + P.T)
    return P


def floor_from_repeats_deg2ps2(runs: Sequence[Run]) -> float | None:
    """The floor without any model: half the mean squared difference of runs of the same test; None
    without such."""
    found = []
    for one, other in combinations(runs, 2):
        if _is_repeat(one, other):
            n = min(np.count_nonzero(~one.preroll), np.count_nonzero(~other.preroll))
            apart = np.degrees(
                one.rate_radps[~one.preroll][:n] - other.rate_radps[~other.preroll][:n]
            )
            found.append(0.5 * float(np.mean(apart**2)))
    return float(np.mean(found)) if found else None


def _is_repeat(one: Run, other: Run) -> bool:
    """The same surface, wave, size and, to a second, length."""
    alike = (one.plane, one.wave) == (other.plane, other.wave)
    alike = alike and abs(one.magnitude_deg - other.magnitude_deg) < 0.01
    return alike and abs(float(one.time_s[-1] - other.time_s[-1])) < 1.0
