"""What disturbs a run, as a Kalman filter that turns residuals into white innovations.

A slow moment (Gauss-Markov) and waves (a narrow band about 0.15 Hz) act on the identified plane
itself; sway or heave is pushed by white force; sensors add white noise and a constant gyro bias.
Residuals of a simulation contain all of it, most of all heading and depth, which wander. Whitened
residuals and whitened sensitivities make least squares the maximum likelihood estimate, with
standard deviations that mean what they say (filter error method; Jategaonkar 2015, ch. 5).

Unknown initial states and biases are states of the filter with a wide prior: each run's own
nuisances are integrated out."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sysid.models.innovations import riccati, whiten, whiten_block
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import NoiseModel

Array = NDArray[np.float64]


class Noise(NamedTuple):
    """Levels of one plane, one standard deviation each; angular accelerations in rad/s^2."""

    rate_radps: float = math.radians(0.1)
    angle_rad: float = math.radians(0.1)
    depth_m: float = 0.01
    slow_radps2: float = math.radians(0.25)
    slow_time_s: float = 3.0
    wave_radps2: float = math.radians(0.3)
    wave_frequency_hz: float = 0.15
    wave_damping: float = 0.1
    force_mps15: float = 0.003
    """Square root of the spectral density of sway or heave acceleration, (m/s^2)/sqrt(Hz)."""


PRIOR_LOG_SD = Noise(1.0, 1.0, 1.0, 1.0, 0.3, 1.0, 0.1, 0.3, 1.0)
"""Prior standard deviation of the logarithm of each level: the shape of the spectrum is known
better than its size."""

MAX_SCORING_STEPS = 30
MIN_IMPROVEMENT = 0.02
"""Fall of the negative log-likelihood that is not worth another step of the noise's search."""
DIFFERENCE = 1e-4
"""Step of its slopes, in logarithms."""
MIN_DEPTH_NOISE_M = 0.01
"""Depth comes as the vehicle's own filtered estimate: smooth to a millimetre, but off by more while
it manoeuvres, in step with what is being identified. Believed to the millimetre it moved every
coefficient of pitch by 1 to 3 sd."""
GYRO_BIAS_RADPS = math.radians(0.5)
START_SPEED_MPS, START_RATE_RADPS, START_ANGLE_RAD, START_DEPTH_M = (
    0.1,
    math.radians(1.0),
    math.radians(2.0),
    0.2,
)
"""Uncertainty of the states a run starts from."""


class Filter(NamedTuple):
    """Time-varying Kalman filter of one plane for runs of up to ``gains.shape[0]`` samples."""

    transition: Array
    output: Array
    gains: Array
    """(n, states, outputs)."""
    whiteners: Array
    """(n, outputs, outputs): inverse Cholesky factor of the innovation covariance."""
    log_dets: Array
    """(n,): log determinant of the innovation covariance."""


def from_model(found: NoiseModel) -> Noise:
    """A model's noise in SI units."""
    return Noise(
        rate_radps=math.radians(found.rate_noise_degps),
        angle_rad=math.radians(found.angle_noise_deg),
        depth_m=found.depth_noise_m,
        slow_radps2=math.radians(found.slow_accel_degps2),
        slow_time_s=found.slow_time_s,
        wave_radps2=math.radians(found.wave_accel_degps2),
        wave_frequency_hz=found.wave_frequency_hz,
        wave_damping=found.wave_damping,
        force_mps15=found.force_noise_mps15,
    )


def build(plane: LinearPlane, noise: Noise, dt: float, samples: int) -> Filter:
    """The filter that whitens residuals of rate, angle and (in pitch) depth, sampled every ``dt``
    seconds."""
    A, density, C, R, P0 = system(plane, noise)
    transition, process = discrete(A, density, dt)
    gains, whiteners, log_dets = riccati(transition, process, C, R, P0, samples)
    return Filter(transition, C, gains, whiteners, log_dets)


def discrete(A: Array, density: Array, dt: float) -> tuple[Array, Array]:
    """Transition and process covariance over ``dt`` from one exponential (Van Loan 1978)."""
    n = A.shape[0]
    block = expm(np.block([[-A, density], [np.zeros((n, n)), A.T]]) * dt)
    transition = np.ascontiguousarray(block[n:, n:].T)
    process = transition @ block[:n, n:]
    return transition, 0.5 * (process + process.T)


def root(covariance: Array) -> Array:
    """R of a covariance R R', one that rounding has left without full rank too."""
    values, axes = np.linalg.eigh(covariance)
    return np.asarray(axes * np.sqrt(np.maximum(values, 0.0)))


def system(plane: LinearPlane, noise: Noise) -> tuple[Array, Array, Array, Array, Array]:
    """Plane, slow moment, wave (two states), gyro bias: A, noise density, C, R, P0."""
    n = plane.A.shape[0]
    slow, wave, bias = n, n + 1, n + 3
    omega = 2.0 * math.pi * noise.wave_frequency_hz
    A = np.zeros((n + 4, n + 4))
    A[:n, :n] = plane.A
    A[:n, slow] = A[:n, wave] = plane.moment
    A[slow, slow] = -1.0 / noise.slow_time_s
    A[wave, wave + 1] = 1.0
    A[wave + 1, wave], A[wave + 1, wave + 1] = -(omega**2), -2.0 * noise.wave_damping * omega
    density = np.zeros_like(A)
    density[0, 0] = noise.force_mps15**2
    density[slow, slow] = 2.0 * noise.slow_radps2**2 / noise.slow_time_s
    density[wave + 1, wave + 1] = 4.0 * noise.wave_damping * omega**3 * noise.wave_radps2**2
    has_depth = "depth" in plane.states
    C = np.zeros((3 if has_depth else 2, n + 4))
    C[0, 1] = C[0, bias] = C[1, 2] = 1.0
    if has_depth:
        C[2, 3] = 1.0
    R = np.diag([noise.rate_radps, noise.angle_rad, noise.depth_m][: C.shape[0]]) ** 2
    start = [START_SPEED_MPS, START_RATE_RADPS, START_ANGLE_RAD, START_DEPTH_M][:n]
    spread = [
        *start,
        noise.slow_radps2,
        noise.wave_radps2,
        noise.wave_radps2 * omega,
        GYRO_BIAS_RADPS,
    ]
    return A, density, C, R, np.diag(spread) ** 2


def whiten_columns(block: Array, by: Filter) -> Array:
    """(samples, outputs, columns): each column whitened as a residual of its own."""
    return whiten_block(
        np.ascontiguousarray(block), by.transition, by.output, by.gains, by.whiteners
    )


def whiten_residual(residual: Array, by: Filter) -> Array:
    return whiten(residual, by.transition, by.output, by.gains, by.whiteners)


def cost(residuals: Sequence[Array], by: Filter) -> float:
    """Negative log-likelihood of the residuals, constants left out."""
    return sum(
        0.5 * float(np.sum(whiten_residual(r, by) ** 2) + np.sum(by.log_dets[: len(r)]))
        for r in residuals
    )


class _CandidateLevels(NamedTuple):
    """Residuals under candidate levels, all runs end to end."""

    innovations: Array
    log_scales: Array
    """Logarithms of the whiteners' diagonals, one beside each innovation."""
    cost: float
    """With what ``PRIOR_LOG_SD`` says of the levels."""


def estimate(plane: LinearPlane, residuals: Sequence[Array], dt: float, start: Noise) -> Noise:
    """Levels that make the residuals most likely, given ``PRIOR_LOG_SD`` about the default ones.

    Fisher scoring on the logarithms: the information of a Gaussian record is the outer product of
    its innovations' slopes and of the logarithms' of their scales (Gupta and Mehra 1974, IEEE
    Trans. AC 19, eq. 32, written for a triangular root)."""
    samples, mean, precision = (
        max(len(r) for r in residuals),
        np.log(Noise()),
        1.0 / np.array(PRIOR_LOG_SD) ** 2,
    )
    lowest, highest = mean - 4.0 * np.array(PRIOR_LOG_SD), mean + 4.0 * np.array(PRIOR_LOG_SD)
    lowest[Noise._fields.index("depth_m")] = math.log(MIN_DEPTH_NOISE_M)

    def at(levels: Array) -> _CandidateLevels:
        by = build(plane, Noise(*np.exp(levels)), dt, samples)
        innovations = np.concatenate([whiten_residual(r, by).ravel() for r in residuals])
        scales = np.log(np.diagonal(by.whiteners, axis1=1, axis2=2))
        log_scales = np.concatenate([scales[: len(r)].ravel() for r in residuals])
        away = levels - mean
        fit = 0.5 * float(innovations @ innovations) - float(np.sum(log_scales))
        return _CandidateLevels(
            innovations, log_scales, fit + 0.5 * float(away @ (precision * away))
        )

    levels = np.clip(np.log(start), lowest, highest)
    here = at(levels)
    for _ in range(MAX_SCORING_STEPS):
        step, promised = _scoring_step(
            at, here, levels, precision * (levels - mean), precision, (lowest, highest)
        )
        if promised < MIN_IMPROVEMENT:
            break
        while (there := at(levels + step)).cost > here.cost and promised > MIN_IMPROVEMENT:
            step, promised = 0.3 * step, 0.3 * promised
        if there.cost > here.cost:
            break
        levels, here = levels + step, there
    return Noise(*(float(level) for level in np.exp(levels)))


def _scoring_step(
    at: Callable[[Array], _CandidateLevels],
    here: _CandidateLevels,
    levels: Array,
    pull: Array,
    precision: Array,
    bounds: tuple[Array, Array],
) -> tuple[Array, float]:
    """A step within the bounds and the fall of the cost that it promises."""
    moved = [at(levels + DIFFERENCE * unit) for unit in np.eye(levels.size)]
    D = np.column_stack([(m.innovations - here.innovations) / DIFFERENCE for m in moved])
    B = np.column_stack([(m.log_scales - here.log_scales) / DIFFERENCE for m in moved])
    slope = D.T @ here.innovations - np.sum(B, axis=0) + pull
    information = D.T @ D + B.T @ B + np.diag(precision)
    lowest, highest = bounds
    free = ~(((levels <= lowest) & (slope > 0.0)) | ((levels >= highest) & (slope < 0.0)))
    step = np.zeros(levels.size)
    step[free] = -np.linalg.solve(information[np.ix_(free, free)], slope[free])
    step = np.clip(levels + np.clip(step, -1.0, 1.0), lowest, highest) - levels
    return step, -float(slope @ step + 0.5 * step @ information @ step)
