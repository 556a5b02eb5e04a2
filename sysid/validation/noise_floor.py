"""Errors of simulated rates: Theil's coefficient, and the floor from noise alone."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.runs import Run
from sysid.models import noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import Noise
from sysid.validation.results import Theil

Array = NDArray[np.float64]

SETTLING_STEPS = 400
"""Steps after which the covariance of a Kalman filter has converged: 40 s."""


class NoiseFloor(NamedTuple):
    """Mean squared rate error of a perfect model, (deg/s)^2: expectation and standard deviation."""

    mean_deg2ps2: float
    sd_deg2ps2: float


def theil(measured: Array, simulated: Array) -> Theil:
    """Return Theil's inequality coefficient and the shares of the mean squared error.

    Parameters
    ----------
    measured : ndarray, (n,)
        Measured series.
    simulated : ndarray, (n,)
        Simulated series, in the same unit.

    Returns
    -------
    Theil
        Coefficient and shares, zero for equal series.

    Notes
    -----
    With y measured, s simulated, and e^2 the mean of (y - s)^2 (Theil 1966, ch. 2)::

        U = e / (sqrt(mean y^2) + sqrt(mean s^2))
        bias = (mean y - mean s)^2 / e^2,    variance = (sd y - sd s)^2 / e^2
        covariance = 1 - bias - variance
    """
    mean_square = float(np.mean((measured - simulated) ** 2))
    rms_sum = np.sqrt(np.mean(measured**2)) + np.sqrt(np.mean(simulated**2))
    if mean_square == 0.0:
        return Theil(coefficient=0.0, bias_share=0.0, variance_share=0.0, covariance_share=0.0)
    bias = float(np.mean(measured) - np.mean(simulated)) ** 2 / mean_square
    variance = float(np.std(measured) - np.std(simulated)) ** 2 / mean_square
    return Theil(
        coefficient=float(np.sqrt(mean_square) / rms_sum),
        bias_share=bias,
        variance_share=variance,
        covariance_share=max(0.0, 1.0 - bias - variance),
    )


def rate_covariance(plane: LinearPlane, level: Noise, dt: float, lead: int, samples: int) -> Array:
    """Return the covariance of the rate error of a perfect model over a test.

    The error is that by disturbance and sensor noise. A run is simulated from its measured start,
    ``lead`` samples before the test. The simulation contains no disturbance, so that the moments on
    the plane have their stationary variances; the other states at the start have the variances of a
    settled Kalman filter. With P_k the state covariance, Phi the transition, Q the process noise, c
    the rate's row of the output matrix::

        P_{k+1} = Phi P_k Phi' + Q,    C_ij = c Phi^(j-i) P_i c'   (j >= i),    C_ii += R_rate

    Small motion is assumed. A tight turn damps the response to the disturbance and leaves up to a
    third less.

    Parameters
    ----------
    plane : LinearPlane
        Small-signal plane.
    level : Noise
        Noise levels.
    dt : float
        Sample time, s.
    lead : int
        Samples from the start of the simulation to the test.
    samples : int
        Samples of the test.

    Returns
    -------
    ndarray, (samples, samples)
        Covariance, (rad/s)^2.
    """
    A, density, output, sensor_covariance, initial_covariance = noise.system(plane, level)
    transition, process = noise.discrete(A, density, dt)
    P = _steady_covariance(transition, process, output, sensor_covariance, initial_covariance)
    n = plane.A.shape[0]
    moment_states = slice(n, n + noise.DISTURBANCE_STATES)
    P[moment_states, :] = P[:, moment_states] = 0.0
    P[moment_states, moment_states] = initial_covariance[moment_states, moment_states]
    rate_row = output[0]
    rate_rows = np.empty((samples, rate_row.size))
    rate_rows[0] = rate_row
    for k in range(1, samples):
        rate_rows[k] = rate_rows[k - 1] @ transition
    C = np.empty((samples, samples))
    for k in range(lead + samples):
        if k >= lead:
            i = k - lead
            C[i, i:] = C[i:, i] = rate_rows[: samples - i] @ (P @ rate_row)
        P = transition @ P @ transition.T + process
    C[np.diag_indices(samples)] += sensor_covariance[0, 0]
    return C


def noise_floor_of(covariance: Array) -> NoiseFloor:
    """Return mean and standard deviation of the mean square of errors with covariance C (n, n).

    The mean is trace(C) / n. For Gaussian noise the variance of the mean square is 2 sum(C_ij^2) /
    n^2.
    """
    scale = float(np.degrees(1.0)) ** 2
    sd = scale * float(np.sqrt(2.0 * np.sum(covariance**2))) / len(covariance)
    return NoiseFloor(scale * float(np.mean(np.diag(covariance))), sd)


def _steady_covariance(
    transition: Array, process: Array, output: Array, sensors: Array, P: Array
) -> Array:
    """Return the covariance of a settled Kalman filter after a measurement.

    P <- Phi P Phi' + Q; K = P H' (H P H' + R)^-1; P <- P - K H P.
    """
    for _ in range(SETTLING_STEPS):
        P = transition @ P @ transition.T + process
        gain = np.linalg.solve(output @ P @ output.T + sensors, output @ P).T
        P = P - gain @ output @ P
        P = 0.5 * (P + P.T)
    return P


def floor_from_repeats_deg2ps2(runs: Sequence[Run]) -> float | None:
    """Return the noise floor without a model, (deg/s)^2.

    Half the mean squared difference of runs of the same test.

    Parameters
    ----------
    runs : sequence of Run
        Runs of one plane.

    Returns
    -------
    float or None
        None if no test was repeated.
    """
    half_mean_squares = []
    for first, second in combinations(runs, 2):
        if _is_repeat(first, second):
            samples = min(np.count_nonzero(~first.preroll), np.count_nonzero(~second.preroll))
            difference_degps = np.degrees(
                first.rate_radps[~first.preroll][:samples]
                - second.rate_radps[~second.preroll][:samples]
            )
            half_mean_squares.append(0.5 * float(np.mean(difference_degps**2)))
    return float(np.mean(half_mean_squares)) if half_mean_squares else None


def _is_repeat(first: Run, second: Run) -> bool:
    """Return whether two runs have the same surface, wave form, magnitude and (to 1 s) duration."""
    is_same = (first.plane, first.wave) == (second.plane, second.wave)
    is_same = is_same and abs(first.magnitude_deg - second.magnitude_deg) < 0.01
    return is_same and abs(float(first.time_s[-1] - second.time_s[-1])) < 1.0
