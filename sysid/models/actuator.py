"""One axis of the tailcone as a bench test sees it: its model, and the fit of that to commands and
duct angles.

The model is the paper's ("Tailcone dynamics modeling": second order, delay, rate limit, travel),
with a gain, the play between motor and duct, and a bias that may move while steps are lost."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import norm
from scipy.stats import t as student

from sysid.data.segments import RATE_HZ
from sysid.models import greybox
from sysid.models.model_file import ParameterEstimate

Array = NDArray[np.float64]

SUBSTEPS = 4
"""Substeps to a sample of the 50 Hz command, as the rate limit needs them."""
BLOCK_S = 2.0
"""Residuals further apart than this count as independent."""
TIMESTAMP_SD_S = 1e-3
"""Of the time stamps of telemetry, which are whole milliseconds: no delay is told more surely than
that."""
DIFFERENCE = 0.02
"""Step of the sensitivities, in units of ``_SCALE``."""
MIN_SENSITIVITY = 1e-6
"""A parameter that moves the duct by less than this, in radians rms over ``_SCALE``, is not in the
data."""


class AxisParameters(NamedTuple):
    """The model's parameters but for the bias."""

    gain: float
    natural_frequency_radps: float
    damping_ratio: float
    delay_s: float
    rate_radps: float
    backlash_rad: float
    """From flank to flank."""


PAPER = AxisParameters(1.0, 3.0, 0.6, 0.3, math.radians(15.0), 0.0)
"""``exp(-0.3 s) / (s^2/9 + 4s/10 + 1)`` at no more than 15 deg/s."""
_SCALE = np.array([0.01, 0.1, 0.03, 0.01, math.radians(0.5), math.radians(0.05)])
_LOWER_BOUND = np.array([0.1, 0.2, 0.05, 0.0, math.radians(0.5), 0.0])
_UPPER_BOUND = np.array([3.0, 60.0, 0.99, 2.0, math.radians(200.0), math.radians(8.0)])


class BenchRecord(NamedTuple):
    """What one axis was told and did in a bench session. Times are vehicle time."""

    start_s: float
    """Of the command's first sample."""
    command_rad: Array
    """On the 50 Hz grid, each held until the next."""
    time_s: Array
    """Of the duct's angles."""
    angle_rad: Array
    spans_s: tuple[tuple[float, float], ...]
    """Start and end of each test."""
    travel_rad: float


class ActuatorFit(NamedTuple):
    """The fit of one axis. A standard deviation is null where the tests do not show the
    parameter."""

    gain: ParameterEstimate
    natural_frequency_radps: ParameterEstimate
    damping_ratio: ParameterEstimate
    delay_s: ParameterEstimate
    rate_radps: ParameterEstimate
    backlash_rad: ParameterEstimate
    bias_rad: ParameterEstimate
    """The mean over the tests, as the encoder shows it: its own zero error is not known."""
    bias_moved_rad: float
    """Last test less first."""
    residual_rad: float
    """Root mean square."""

    @property
    def axis(self) -> AxisParameters:
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
    """The model's duct angle (rad, no bias) at the times of the measured ones."""
    dt = 1.0 / (RATE_HZ * SUBSTEPS)
    motor = greybox.Actuator(
        axis.delay_s,
        axis.natural_frequency_radps,
        axis.damping_ratio,
        0.0,
        record.travel_rad,
        axis.rate_radps / axis.gain,
        axis.backlash_rad / axis.gain,
    )
    duct = axis.gain * greybox.duct_angles(np.repeat(record.command_rad, SUBSTEPS), motor, dt)
    grid_s = record.start_s + dt * np.arange(duct.size)
    return np.interp(record.time_s, grid_s, duct)


def fit(record: BenchRecord, starts: Sequence[AxisParameters] = (PAPER,)) -> ActuatorFit:
    """Least squares on every angle measured during the tests, each test with a bias of its own.

    Standard deviations allow for residuals that hang together (the sandwich of Liang and Zeger
    1986): quantisation and whatever else the model lacks is no white noise, and in a sinusoid it
    comes back every period. Of blocks of ``BLOCK_S`` and of whole tests, whichever tells of more
    counts."""
    tests = [np.flatnonzero((record.time_s >= a) & (record.time_s <= b)) for a, b in record.spans_s]
    inside = np.concatenate(tests)
    owner = np.repeat(np.arange(len(tests)), [len(test) for test in tests])

    def misfit(z: Array) -> Array:
        return (record.angle_rad - duct_angles(record, AxisParameters(*(z * _SCALE))))[inside]

    def residual(z: Array) -> Array:
        off = misfit(z)
        return off - (np.bincount(owner, off) / np.bincount(owner))[owner]

    def jacobian(z: Array) -> Array:
        base = residual(z)
        steps = np.where(z * _SCALE + DIFFERENCE * _SCALE > _UPPER_BOUND, -DIFFERENCE, DIFFERENCE)
        return np.column_stack(
            [(residual(z + step) - base) / step[step != 0] for step in np.diag(steps)]
        )

    bounds = _LOWER_BOUND / _SCALE, _UPPER_BOUND / _SCALE
    tries = [
        least_squares(residual, np.clip(start / _SCALE, *bounds), jacobian, bounds)
        for start in starts
    ]
    best = min(tries, key=lambda found: float(found.cost))
    clusterings = _block_numbers(record.time_s[inside], owner), owner
    sd = [
        _max_deviation(of)
        for of in zip(*(_deviations(best.jac, best.fun, each) for each in clusterings), strict=True)
    ]
    off = misfit(best.x)
    biases = np.bincount(owner, off) / np.bincount(owner)
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
        gain, frequency, damping, delay, rate, play, bias, float(biases[-1] - biases[0]), rms_rad
    )


def _max_deviation(deviations: tuple[float | None, ...]) -> float | None:
    """None where the data do not show the parameter; they show it to every clustering or to
    none."""
    return max((sd for sd in deviations if sd is not None), default=None)


def _standard_error(values: Array) -> float | None:
    return float(np.std(values, ddof=1) / math.sqrt(values.size)) if values.size > 1 else None


def _block_numbers(time_s: Array, owner: NDArray[np.int_]) -> NDArray[np.int_]:
    """The number of the block that each residual belongs to; none reaches over two tests."""
    _, blocks = np.unique(np.floor(time_s / BLOCK_S) + 1e9 * owner, return_inverse=True)
    return np.asarray(blocks, dtype=np.int_)


def _deviations(jacobian: Array, residual: Array, blocks: NDArray[np.int_]) -> list[float | None]:
    """One standard deviation of each parameter, in its own unit; None where the data do not show
    it.

    Of few blocks it is itself unsure: widened so that 1.96 of it reach as far as Student's t does
    (Cameron and Miller 2015, section VI)."""
    shown = np.sqrt(np.mean(jacobian**2, axis=0)) > MIN_SENSITIVITY
    J = jacobian[:, shown]
    bread = np.linalg.pinv(J.T @ J)
    scores = np.column_stack([np.bincount(blocks, column * residual) for column in J.T])
    count = len(scores)
    meat = scores.T @ scores * count / max(1, count - J.shape[1])
    few = float(student.ppf(0.975, max(1, count - 1)) / norm.ppf(0.975))
    sd = iter(few * np.sqrt(np.diag(bread @ meat @ bread)) * _SCALE[shown])
    return [float(next(sd)) if each else None for each in shown]
