"""Model of one tailcone axis, and its fit to commands and duct angles of a bench test.

The model is the paper's ("Tailcone dynamics modeling": second-order lag, delay, rate limit, travel)
with three additions: a gain, the backlash between motor and duct, and a bias per test, because lost
steps change the bias:

    duct = gain backlash(lag(command(t - delay))) + bias_i   in test i, rad,
    lag(s) = wn^2 / (s^2 + 2 zeta wn s + wn^2), rate limited.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ndtri, stdtrit

from sysid.data.runs import RATE_HZ
from sysid.models import greybox
from sysid.models.model_file import ParameterEstimate

Array = NDArray[np.float64]

SUBSTEPS = 4
"""Integration steps per sample of the 50 Hz command, needed for the rate limit."""
BLOCK_S = 2.0
"""Length of a block of residuals; residuals of different blocks are treated as independent."""
TIMESTAMP_SD_S = 1e-3
"""Standard deviation of telemetry time stamps, which are whole milliseconds.

It is the lower bound for the standard deviation of the delay."""
DIFFERENCE = 0.02
"""Step of the finite differences, in units of ``_SCALE``."""
MIN_SENSITIVITY = 1e-6
"""Sensitivity of the duct angle (rad rms per ``_SCALE``) below which a parameter is unidentifiable.
"""


class AxisParameters(NamedTuple):
    """Parameters of the model without the bias."""

    gain: float
    """Duct angle per commanded angle."""
    natural_frequency_radps: float
    damping_ratio: float
    delay_s: float
    rate_radps: float
    """Rate limit of the duct."""
    backlash_rad: float
    """Backlash at the duct, full width."""


PAPER = AxisParameters(
    gain=1.0,
    natural_frequency_radps=3.0,
    damping_ratio=0.6,
    delay_s=0.3,
    rate_radps=math.radians(15.0),
    backlash_rad=0.0,
)
"""Paper: ``exp(-0.3 s) / (s^2/9 + 4s/10 + 1)`` with a rate limit of 15 deg/s."""
_SCALE = np.array([0.01, 0.1, 0.03, 0.01, math.radians(0.5), math.radians(0.05)])
"""Scale of each parameter in the fit, in the order of ``AxisParameters``."""
_LOWER_BOUND = np.array([0.1, 0.2, 0.05, 0.0, math.radians(0.5), 0.0])
_UPPER_BOUND = np.array([3.0, 60.0, 0.99, 2.0, math.radians(200.0), math.radians(8.0)])


class BenchRecord(NamedTuple):
    """Commands and measured angles of one axis in a bench session; times are vehicle time."""

    start_s: float
    """Time of the first command sample."""
    command_rad: Array
    """Commanded angle on a 50 Hz grid, zero-order hold."""
    time_s: Array
    """Times of ``angle_rad``."""
    angle_rad: Array
    """Duct angle measured by the encoder."""
    spans_s: tuple[tuple[float, float], ...]
    """Start and end of each test."""
    travel_rad: float
    """Limit of the command."""


class ActuatorFit(NamedTuple):
    """Fit of one axis; a standard deviation is None for an unidentifiable parameter."""

    gain: ParameterEstimate
    natural_frequency_radps: ParameterEstimate
    damping_ratio: ParameterEstimate
    delay_s: ParameterEstimate
    rate_radps: ParameterEstimate
    backlash_rad: ParameterEstimate
    bias_rad: ParameterEstimate
    """Mean over the tests; it includes the unknown zero error of the encoder."""
    bias_change_rad: float
    """Bias of the last test minus that of the first."""
    residual_rad: float
    """Root mean square of the residuals."""

    @property
    def axis(self) -> AxisParameters:
        """Return the estimated values without their standard deviations."""
        estimates = (
            self.gain,
            self.natural_frequency_radps,
            self.damping_ratio,
            self.delay_s,
            self.rate_radps,
            self.backlash_rad,
        )
        return AxisParameters(*(estimate.value for estimate in estimates))


def duct_angles(record: BenchRecord, axis: AxisParameters) -> Array:
    """Return the duct angle of the model at the times of the measurement.

    Parameters
    ----------
    record : BenchRecord
        Commands and times.
    axis : AxisParameters
        Parameters of the model.

    Returns
    -------
    ndarray
        Duct angle without bias, rad, one per entry of ``record.time_s``.
    """
    dt = 1.0 / (RATE_HZ * SUBSTEPS)
    motor = greybox.Actuator(
        delay_s=axis.delay_s,
        natural_frequency_radps=axis.natural_frequency_radps,
        damping_ratio=axis.damping_ratio,
        bias_rad=0.0,
        travel_rad=record.travel_rad,
        rate_radps=axis.rate_radps / axis.gain,
        backlash_rad=axis.backlash_rad / axis.gain,
    )
    duct = axis.gain * greybox.duct_angles(np.repeat(record.command_rad, SUBSTEPS), motor, dt)
    grid_s = record.start_s + dt * np.arange(duct.size)
    return np.interp(record.time_s, grid_s, duct)


def fit(record: BenchRecord, starts: Sequence[AxisParameters] = (PAPER,)) -> ActuatorFit:
    """Fit one axis by least squares to all angles measured during the tests.

    Parameters
    ----------
    record : BenchRecord
        Commands, measured angles and times of the tests.
    starts : sequence of AxisParameters
        Initial values; the fit with the lowest cost is returned.

    Returns
    -------
    ActuatorFit
        Parameters with standard deviations, bias and residual.

    Notes
    -----
    Each test has a bias of its own, which is eliminated from the residuals. Standard deviations are
    cluster-robust (the sandwich estimator of Liang and Zeger 1986), because quantisation and model
    errors are not white noise and repeat in every period of a sinusoid. Clusters are blocks of
    ``BLOCK_S`` and whole tests. With few clusters the sandwich can be small by chance; the lower
    bound takes each test for as much evidence as half a period of its command.
    """
    # z parameters in units of _SCALE, r_j residual of sample j (rad), b_i bias of test i:
    #     r_j = angle_j - duct(t_j; z) - b_i,   b_i = mean over test i,   z = argmin 1/2 sum r_j^2.
    # Jacobian by one-sided differences, backward at the upper bound.
    tests = [np.flatnonzero((record.time_s >= a) & (record.time_s <= b)) for a, b in record.spans_s]
    test_samples = np.concatenate(tests)
    test_number = np.repeat(np.arange(len(tests)), [len(test) for test in tests])

    def duct_error(z: Array) -> Array:
        return (record.angle_rad - duct_angles(record, AxisParameters(*(z * _SCALE))))[test_samples]

    def residual(z: Array) -> Array:
        """Return the deviations of the duct angle minus their mean in each test."""
        deviations = duct_error(z)
        return (
            deviations
            - (np.bincount(test_number, deviations) / np.bincount(test_number))[test_number]
        )

    def jacobian(z: Array) -> Array:
        """Return the slopes of ``residual`` by one-sided differences within the bounds."""
        base = residual(z)
        steps = np.where(z * _SCALE + DIFFERENCE * _SCALE > _UPPER_BOUND, -DIFFERENCE, DIFFERENCE)
        return np.column_stack(
            [(residual(z + step) - base) / step[step != 0] for step in np.diag(steps)]
        )

    bounds = _LOWER_BOUND / _SCALE, _UPPER_BOUND / _SCALE
    results = [
        least_squares(residual, np.clip(start / _SCALE, *bounds), jacobian, bounds)
        for start in starts
    ]
    best = min(results, key=lambda result: float(result.cost))
    clusterings = test_number, _block_numbers(record.time_s[test_samples], test_number)
    half_periods = _half_periods(record)[test_number]
    sd = _standard_deviations(best.jac, best.fun, clusterings, half_periods)
    error = duct_error(best.x)
    biases = np.bincount(test_number, error) / np.bincount(test_number)
    gain, frequency, damping, delay, rate, play = (
        ParameterEstimate(float(value), deviation)
        for value, deviation in zip(best.x * _SCALE, sd, strict=True)
    )
    delay = ParameterEstimate(
        delay.value, None if delay.sd is None else math.hypot(delay.sd, TIMESTAMP_SD_S)
    )
    bias = ParameterEstimate(float(np.mean(biases)), _standard_error(biases))
    rms_rad = float(np.sqrt(np.mean(best.fun**2)))
    return ActuatorFit(
        gain=gain,
        natural_frequency_radps=frequency,
        damping_ratio=damping,
        delay_s=delay,
        rate_radps=rate,
        backlash_rad=play,
        bias_rad=bias,
        bias_change_rad=float(biases[-1] - biases[0]),
        residual_rad=rms_rad,
    )


def _standard_error(values: Array) -> float | None:
    """Return the standard error of the mean; None for a single value."""
    return float(np.std(values, ddof=1) / math.sqrt(values.size)) if values.size > 1 else None


def _block_numbers(time_s: Array, test_number: NDArray[np.int_]) -> NDArray[np.int_]:
    """Return the block number of each residual; a block is within one test."""
    _, blocks = np.unique(np.floor(time_s / BLOCK_S) + 1e9 * test_number, return_inverse=True)
    return np.asarray(blocks, dtype=np.int_)


def _half_periods(record: BenchRecord) -> NDArray[np.int_]:
    """Return the number of half periods of the command in each test, at least 1."""
    time_s = record.start_s + np.arange(record.command_rad.size) / RATE_HZ
    commands = [record.command_rad[(time_s >= a) & (time_s <= b)] for a, b in record.spans_s]
    return np.array([max(1, np.count_nonzero(np.diff(np.sign(c - c.mean())))) for c in commands])


def _standard_deviations(
    jacobian: Array,
    residual: Array,
    clusterings: tuple[NDArray[np.int_], ...],
    half_periods: NDArray[np.int_],
) -> list[float | None]:
    """Return one standard deviation per parameter in its unit; None for an unidentifiable one.

    The largest one of all clusterings and of the lower bound for errors that repeat is returned.
    """
    is_identifiable = np.sqrt(np.mean(jacobian**2, axis=0)) > MIN_SENSITIVITY
    J = jacobian[:, is_identifiable]
    candidates = [_clustered_deviations(J, residual, clusters) for clusters in clusterings]
    candidates.append(_half_period_deviations(J, residual, half_periods))
    largest = iter(np.max(candidates, axis=0) * _SCALE[is_identifiable])
    return [float(next(largest)) if identifiable else None for identifiable in is_identifiable]


def _half_period_deviations(J: Array, residual: Array, half_periods: NDArray[np.int_]) -> Array:
    """Return the standard deviation of each column of ``J`` for errors that repeat.

    ``half_periods`` is the number of half periods of the test of each residual.
    """
    # Residuals that are the same in each of the h_t half periods of test t count once:
    # P = s^2 (sum_t J_t^T J_t / h_t)^-1 with the mean square s^2 of the residuals.
    covariance = np.linalg.pinv(J.T @ (J / half_periods[:, None]))
    return np.asarray(np.sqrt(np.mean(residual**2) * np.diag(covariance)))


def _clustered_deviations(J: Array, residual: Array, clusters: NDArray[np.int_]) -> Array:
    """Return the standard deviation of each column of ``J`` for errors of independent clusters."""
    # Sandwich estimator (Liang and Zeger 1986): (J^T J)^-1 (sum_c s_c s_c^T) (J^T J)^-1 with the
    # score s_c = J_c^T r_c of cluster c. For few clusters the result is scaled by
    # t_0.975(clusters - 1) / 1.96 (Cameron and Miller 2015, section VI).
    bread = np.linalg.pinv(J.T @ J)
    scores = np.column_stack([np.bincount(clusters, column * residual) for column in J.T])
    count = len(scores)
    meat = scores.T @ scores * count / max(1, count - J.shape[1])
    small_sample_factor = float(stdtrit(max(1, count - 1), 0.975) / ndtri(0.975))
    return np.asarray(small_sample_factor * np.sqrt(np.diag(bread @ meat @ bread)))
