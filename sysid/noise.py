"""What disturbs a run, as a Kalman filter that turns residuals into white innovations.

A slow moment (Gauss-Markov) and waves (a narrow band about 0.15 Hz) act on the identified plane itself; sway or heave
is pushed by white force; sensors add white noise and a constant gyro bias. Residuals of a simulation contain all of
it, most of all heading and depth, which wander. Whitened residuals and whitened sensitivities make least squares the
maximum likelihood estimate, with standard deviations that mean what they say (filter error method; Jategaonkar 2015,
ch. 5).

Unknown initial states and biases are states of the filter with a wide prior: each run's own nuisances are integrated
out.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import minimize

from sitl.vehicle.kernel import kernel
from sysid.planes import LinearPlane

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


BELIEF = Noise(1.0, 1.0, 1.0, 1.0, 0.3, 1.0, 0.1, 0.3, 1.0)
"""Prior standard deviation of the logarithm of each level: the shape of the spectrum is known better than its size."""

LEAST_DEPTH_NOISE_M = 0.01
"""Depth comes as the vehicle's own filtered estimate: smooth to a millimetre, but off by more while it manoeuvres, in
step with what is being identified. Believed to the millimetre it moved every coefficient of pitch by 1 to 3 sd."""
GYRO_BIAS_RADPS = math.radians(0.5)
START_SPEED_MPS, START_RATE_RADPS, START_ANGLE_RAD, START_DEPTH_M = 0.1, math.radians(1.0), math.radians(2.0), 0.2
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


def build(plane: LinearPlane, noise: Noise, dt: float, samples: int) -> Filter:
    """The filter that whitens residuals of rate, angle and (in pitch) depth, sampled every ``dt`` seconds."""
    A, density, C, R, P0 = system(plane, noise)
    transition, process = discrete(A, density, dt)
    gains, whiteners, log_dets = _riccati(transition, process, C, R, P0, samples)
    return Filter(transition, C, gains, whiteners, log_dets)


def discrete(A: Array, density: Array, dt: float) -> tuple[Array, Array]:
    """Transition and process covariance over ``dt`` from one exponential (Van Loan 1978)."""
    n = A.shape[0]
    block = expm(np.block([[-A, density], [np.zeros((n, n)), A.T]]) * dt)
    transition = np.ascontiguousarray(block[n:, n:].T)
    process = transition @ block[:n, n:]
    return transition, 0.5 * (process + process.T)


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
    spread = [*start, noise.slow_radps2, noise.wave_radps2, noise.wave_radps2 * omega, GYRO_BIAS_RADPS]
    return A, density, C, R, np.diag(spread) ** 2


@kernel
def _riccati(A: Array, Q: Array, C: Array, R: Array, P0: Array, samples: int) -> tuple[Array, Array, Array]:
    """Gains, whiteners and log determinants of the filter, which repeats its last gain once it has settled."""
    n, outputs = A.shape[0], C.shape[0]
    gains = np.empty((samples, n, outputs))
    whiteners = np.empty((samples, outputs, outputs))
    log_dets = np.empty(samples)
    P = P0.copy()
    settled = False
    for k in range(samples):
        if settled:
            gains[k], whiteners[k], log_dets[k] = gains[k - 1], whiteners[k - 1], log_dets[k - 1]
            continue
        PC = P @ C.T
        L = np.linalg.cholesky(C @ PC + R)
        W = np.linalg.inv(L)
        K = PC @ (W.T @ W)
        gains[k], whiteners[k] = K, W
        log_dets[k] = 2.0 * np.sum(np.log(np.diag(L)))
        P = A @ (P - K @ PC.T) @ A.T + Q
        P = 0.5 * (P + P.T)
        if k > 0:
            settled = np.max(np.abs(K - gains[k - 1])) < 1e-9 * np.max(np.abs(K))
    return gains, whiteners, log_dets


@kernel
def whiten(residual: Array, transition: Array, output: Array, gains: Array, whiteners: Array) -> Array:
    """Normalised innovations, (samples, outputs): white and of unit variance if the noise model holds."""
    samples, outputs = residual.shape
    n = transition.shape[0]
    white = np.empty((samples, outputs))
    x, updated, e = np.zeros(n), np.empty(n), np.empty(outputs)
    for k in range(samples):
        for i in range(outputs):
            e[i] = residual[k, i]
            for j in range(n):
                e[i] -= output[i, j] * x[j]
        for i in range(outputs):
            white[k, i] = 0.0
            for j in range(i + 1):
                white[k, i] += whiteners[k, i, j] * e[j]
        for i in range(n):
            updated[i] = x[i]
            for j in range(outputs):
                updated[i] += gains[k, i, j] * e[j]
        for i in range(n):
            x[i] = 0.0
            for j in range(n):
                x[i] += transition[i, j] * updated[j]
    return white


def whitened(residual: Array, by: Filter) -> Array:
    return whiten(residual, by.transition, by.output, by.gains, by.whiteners)


def cost(residuals: Sequence[Array], by: Filter) -> float:
    """Negative log-likelihood of the residuals, constants left out."""
    return sum(0.5 * float(np.sum(whitened(r, by) ** 2) + np.sum(by.log_dets[: len(r)])) for r in residuals)


def estimate(plane: LinearPlane, residuals: Sequence[Array], dt: float, start: Noise) -> Noise:
    """Levels that make the residuals most likely, given ``BELIEF`` about the default ones."""
    samples = max(len(residual) for residual in residuals)
    mean = np.log(Noise())

    def objective(log_levels: Array) -> float:
        by = build(plane, Noise(*np.exp(log_levels)), dt, samples)
        return cost(residuals, by) + 0.5 * float(np.sum(((log_levels - mean) / BELIEF) ** 2))

    bounds = [(m - 4.0 * sd, m + 4.0 * sd) for m, sd in zip(mean, BELIEF, strict=True)]
    depth = Noise._fields.index("depth_m")
    bounds[depth] = (math.log(LEAST_DEPTH_NOISE_M), bounds[depth][1])
    found = minimize(objective, np.log(start), method="L-BFGS-B", bounds=bounds, options={"maxiter": 40, "ftol": 1e-7})
    return Noise(*(float(level) for level in np.exp(found.x)))
