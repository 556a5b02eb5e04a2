"""Noise model of a plane: a Kalman filter that turns residuals into white innovations.

Disturbances: a slow moment (Gauss-Markov) and a wave moment (narrow band about 0.15 Hz) act on the
identified plane, and white force acts on sway or heave. Sensors add white noise, a constant gyro
bias and a slow drift of the angle. The residuals of a simulation contain all of these. With
whitened residuals and whitened sensitivities, least squares is the maximum likelihood estimate and
its standard deviations are correct (filter error method; Jategaonkar 2015, ch. 5).

State x = (plane, s, w1, w2, b, a) with s slow angular acceleration (rad/s^2), w1 wave angular
acceleration (rad/s^2), w2 = w1', b gyro bias (rad/s), a drift of the angle (rad):

    plane' = A_p plane + moment (s + w1) + white force on the cross speed
    s'  = -s/T + white,                          sd of s: slow_radps2, T: slow_time_s
    w2' = -omega^2 w1 - 2 zeta omega w2 + white, sd of w1: wave_radps2, omega = 2 pi wave_frequency
    b'  = 0
    a'  = -a/T_a + white,                        sd of a: ANGLE_DRIFT_RAD, T_a: ANGLE_DRIFT_S
    outputs: rate + b, angle + a, and depth in pitch, plus white noise.

Spectral densities that give these standard deviations: 2 sd^2 / T for s and a, 4 zeta omega^3 sd^2
for w2. Initial states and bias of a run have a wide prior, so that they are integrated out.

In swell the pressure of waves moves the measured depth by some centimetres while the vehicle stays
where it is in the water. The states h1, h2 = h1' then follow a: the equations of the wave moment
with its frequency and damping, sd of h1: wave_depth_m, and the output depth + h1.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from mavlink_io.frames import STANDARD_GRAVITY_MPS2
from sysid.models.innovations import riccati, whiten, whiten_block
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import NoiseModel
from sysid.planes import Plane

Array = NDArray[np.float64]

DISTURBANCE_STATES = 3
"""Number of states of the disturbance: slow moment, wave moment and its rate."""


class Noise(NamedTuple):
    """Noise levels of one plane; each level is one standard deviation."""

    rate_radps: float = math.radians(0.1)
    """White noise of the rate sensor."""
    angle_rad: float = math.radians(0.1)
    """White noise of heading or pitch."""
    depth_m: float = 0.01
    """White noise of depth."""
    slow_radps2: float = math.radians(0.25)
    """Angular acceleration by the slow moment."""
    slow_time_s: float = 3.0
    """Correlation time of the slow moment."""
    wave_radps2: float = math.radians(0.3)
    """Angular acceleration by the wave moment."""
    wave_frequency_hz: float = 0.15
    """Centre frequency of the wave moment."""
    wave_damping: float = 0.1
    """Damping ratio, which sets the bandwidth of the wave moment."""
    force_mps15: float = 0.003
    """Square root of the spectral density of sway or heave acceleration, (m/s^2)/sqrt(Hz)."""
    wave_depth_m: float = 0.0
    """Measured depth by the pressure of waves; 0 where the data do not show it."""
    test_depth_m: float = 0.0
    """Depth at which the waves were measured; not a level."""


PRIOR_LOG_SD = Noise(
    rate_radps=1.0,
    angle_rad=1.0,
    depth_m=1.0,
    slow_radps2=1.0,
    slow_time_s=0.3,
    wave_radps2=1.0,
    wave_frequency_hz=0.1,
    wave_damping=0.3,
    force_mps15=1.0,
    wave_depth_m=1.0,
)
"""Prior standard deviation of the logarithm of each level.

The shape of the spectrum is known better than its size."""

WAVE_DEPTH_M = 0.005
"""Prior mean of ``wave_depth_m`` where there is any."""
WAVE_DEPTH_EVIDENCE = 5.0
"""Decrease of the negative log posterior from which on the pressure of waves is in the model.

Without waves it occurs in one log of 600 (chi-square with one degree of freedom)."""
MAX_SCORING_STEPS = 30
"""Maximum number of steps of the noise estimate."""
MIN_IMPROVEMENT = 0.02
"""Decrease of the negative log-likelihood below which the noise estimate stops."""
DIFFERENCE = 1e-4
"""Step of the finite differences, in the logarithm of a level."""
MIN_DEPTH_NOISE_M = 0.01
"""Minimum depth noise.

Logged depth is the vehicle's filtered estimate: smooth to 1 mm, but with larger errors during a
manoeuvre, correlated with the motion. With 1 mm of noise, every pitch coefficient changed by 1 to 3
sd."""
ANGLE_DRIFT_RAD, ANGLE_DRIFT_S = math.radians(0.1), 10.0
"""Drift of the measured angles: standard deviation and correlation time.

Logged angles are the autopilot's estimates, mainly the integral of the measured rate: smooth to
0.003 deg, but with the integrated noise of the gyro as their error, and half a tick late. Without
drift they outweigh the rate, and b1 is one standard deviation too small."""
GYRO_BIAS_RADPS = math.radians(0.5)
"""Prior standard deviation of the gyro bias."""
START_SPEED_MPS, START_RATE_RADPS, START_ANGLE_RAD, START_DEPTH_M = (
    0.1,
    math.radians(1.0),
    math.radians(2.0),
    0.2,
)
"""Prior standard deviations of the states at the start of a run."""


class Filter(NamedTuple):
    """Time-varying Kalman filter of one plane for runs of up to ``gains.shape[0]`` samples."""

    transitions: Array
    """(segments, states, states), transition over one sample; one segment if it is constant."""
    hold: int
    """Samples of a segment; the last one holds until the end."""
    output: Array
    """(outputs, states), output matrix."""
    gains: Array
    """(n, states, outputs), gain of each sample."""
    whiteners: Array
    """(n, outputs, outputs): inverse Cholesky factor of the innovation covariance."""
    log_dets: Array
    """(n,): log determinant of the innovation covariance."""


def from_model(noise_model: NoiseModel) -> Noise:
    """Return the noise of a model file in SI units and radians."""
    return Noise(
        rate_radps=math.radians(noise_model.rate_noise_degps),
        angle_rad=math.radians(noise_model.angle_noise_deg),
        depth_m=noise_model.depth_noise_m,
        slow_radps2=math.radians(noise_model.slow_accel_degps2),
        slow_time_s=noise_model.slow_time_s,
        wave_radps2=math.radians(noise_model.wave_accel_degps2),
        wave_frequency_hz=noise_model.wave_frequency_hz,
        wave_damping=noise_model.wave_damping,
        force_mps15=noise_model.force_noise_mps15,
        wave_depth_m=noise_model.wave_depth_m,
        test_depth_m=noise_model.test_depth_m,
    )


def at_depth(levels: Mapping[Plane, Noise], depth_m: float) -> dict[Plane, Noise]:
    """Return the noise at another depth than that of the tests.

    Parameters
    ----------
    levels : Mapping
        Noise of each plane.
    depth_m : float
        Depth.

    Returns
    -------
    dict
        Noise of each plane. Only waves change with the depth, if the tests show their pressure.

    Notes
    -----
    Under waves of the frequency omega in deep water all motion decays with the depth d as
    exp(-k d), k = omega^2 / g (Airy 1845; Newman 1977, Marine Hydrodynamics, ch. 6.2).
    """
    pitch = levels.get(Plane.PITCH)
    if pitch is None or not pitch.wave_depth_m:
        return dict(levels)

    def scaled(noise: Noise) -> Noise:
        """Return the noise of one plane at that depth."""
        wave_number = (2.0 * math.pi * noise.wave_frequency_hz) ** 2 / STANDARD_GRAVITY_MPS2
        ratio = math.exp(wave_number * (noise.test_depth_m - depth_m))
        return noise._replace(
            wave_radps2=ratio * noise.wave_radps2,
            wave_depth_m=ratio * noise.wave_depth_m,
            test_depth_m=depth_m,
        )

    return {plane: scaled(noise) for plane, noise in levels.items()}


def to_model(level: Noise) -> NoiseModel:
    """Return noise levels in the units of the model file."""
    return NoiseModel(
        slow_accel_degps2=math.degrees(level.slow_radps2),
        slow_time_s=level.slow_time_s,
        wave_accel_degps2=math.degrees(level.wave_radps2),
        wave_frequency_hz=level.wave_frequency_hz,
        wave_damping=level.wave_damping,
        rate_noise_degps=math.degrees(level.rate_radps),
        angle_noise_deg=math.degrees(level.angle_rad),
        depth_noise_m=level.depth_m,
        force_noise_mps15=level.force_mps15,
        wave_depth_m=level.wave_depth_m,
        test_depth_m=level.test_depth_m,
    )


def build(plane: LinearPlane, noise: Noise, dt: float, samples: int) -> Filter:
    """Return the filter that whitens residuals of rate, angle and (in pitch) depth.

    Parameters
    ----------
    plane : LinearPlane
        Linear model of the plane, FRD axes.
    noise : Noise
        Noise levels.
    dt : float
        Sample interval of the residuals, s.
    samples : int
        Number of samples of the longest run.

    Returns
    -------
    Filter
        Gains and whiteners per sample.
    """
    return build_along([plane], noise, dt, samples, hold=samples)


def build_along(
    planes: Sequence[LinearPlane], noise: Noise, dt: float, samples: int, hold: int
) -> Filter:
    """Return the filter of a run whose system matrix changes during the manoeuvre.

    Parameters
    ----------
    planes : sequence of LinearPlane
        Linear model of the plane in each segment, FRD axes.
    noise : Noise
        Noise levels.
    dt : float
        Sample interval of the residuals, s.
    samples : int
        Number of samples of the run.
    hold : int
        Samples of a segment.

    Returns
    -------
    Filter
        Transitions per segment, gains and whiteners per sample.
    """
    A, density, C, R, P0 = system(planes[0], noise)
    matrices = np.repeat(A[None], len(planes), axis=0)
    states = len(planes[0].A)
    matrices[:, :states, :states] = [plane.A for plane in planes]
    transitions, processes = discrete(matrices, density, dt)
    gains, whiteners, log_dets = riccati(transitions, processes, hold, C, R, P0, samples)
    return Filter(
        transitions=transitions,
        hold=hold,
        output=C,
        gains=gains,
        whiteners=whiteners,
        log_dets=log_dets,
    )


def discrete(A: Array, density: Array, dt: float) -> tuple[Array, Array]:
    """Return transition and process covariance over ``dt`` from one matrix exponential.

    Parameters
    ----------
    A : ndarray, shape (n, n) or (k, n, n)
        One or several system matrices.
    density : ndarray, shape (n, n)
        Spectral density of the process noise.
    dt : float
        Period, in seconds.

    Returns
    -------
    transition : ndarray, shape of A
        exp(A dt).
    process : ndarray, shape of A
        Covariance of the state after ``dt`` without initial uncertainty.

    Notes
    -----
    C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automatic
    Control 23 (1978).
    """
    # Van Loan 1978: expm([[-A, density], [0, A^T]] dt) = [[., F], [0, Ad^T]], Q = Ad F.
    n = A.shape[-1]
    joint = np.zeros((*A.shape[:-2], 2 * n, 2 * n))
    joint[..., :n, :n], joint[..., :n, n:], joint[..., n:, n:] = -A, density, A.mT
    block = expm(joint * dt)
    transition = np.ascontiguousarray(block[..., n:, n:].mT)
    process = transition @ block[..., :n, n:]
    return transition, 0.5 * (process + process.mT)


def root(covariance: Array) -> Array:
    """Return R with covariance = R R^T, also for a covariance that is singular by rounding."""
    values, axes = np.linalg.eigh(covariance)
    return np.asarray(axes * np.sqrt(np.maximum(values, 0.0)))


def system(plane: LinearPlane, noise: Noise) -> tuple[Array, Array, Array, Array, Array]:
    """Return the continuous noise model of a plane.

    Parameters
    ----------
    plane : LinearPlane
        Linear model of the plane, FRD axes.
    noise : Noise
        Noise levels.

    Returns
    -------
    A, density, C, R, P0 : ndarray
        System matrix, spectral density of the process noise, output matrix, covariance of the
        measurement noise, and covariance of the initial state. States: plane, slow moment, wave
        (two states), gyro bias, drift of the angle, and in pitch, if the noise has it, wave
        pressure (two states).

    Notes
    -----
    The module docstring has the equations.
    """
    # Equations: module docstring; rows and columns: plane (n), s, w1, w2, b, a, h1, h2.
    n, has_depth = plane.A.shape[0], "depth" in plane.states
    slow, wave, bias, drift, pressure = n, n + 1, n + 3, n + 4, n + 5
    has_pressure = has_depth and noise.wave_depth_m > 0.0
    size = n + 7 if has_pressure else n + 5
    omega = 2.0 * math.pi * noise.wave_frequency_hz
    A = np.zeros((size, size))
    A[:n, :n] = plane.A
    A[:n, slow] = A[:n, wave] = plane.moment
    A[slow, slow], A[drift, drift] = -1.0 / noise.slow_time_s, -1.0 / ANGLE_DRIFT_S
    density = np.zeros_like(A)
    waves = ((wave, noise.wave_radps2), (pressure, noise.wave_depth_m))
    for state, sd in waves if has_pressure else waves[:1]:
        both = slice(state, state + 2)
        A[both, both], density[both, both] = oscillator(noise, sd)
    density[0, 0] = noise.force_mps15**2
    density[slow, slow] = 2.0 * noise.slow_radps2**2 / noise.slow_time_s
    density[drift, drift] = 2.0 * ANGLE_DRIFT_RAD**2 / ANGLE_DRIFT_S
    C = np.zeros((3 if has_depth else 2, size))
    C[0, 1] = C[0, bias] = C[1, 2] = C[1, drift] = 1.0
    if has_depth:
        C[2, 3] = 1.0
    if has_pressure:
        C[2, pressure] = 1.0
    R = np.diag([noise.rate_radps, noise.angle_rad, noise.depth_m][: C.shape[0]]) ** 2
    start = [START_SPEED_MPS, START_RATE_RADPS, START_ANGLE_RAD, START_DEPTH_M][:n]
    spread = [
        *start,
        noise.slow_radps2,
        noise.wave_radps2,
        noise.wave_radps2 * omega,
        GYRO_BIAS_RADPS,
        ANGLE_DRIFT_RAD,
        noise.wave_depth_m,
        noise.wave_depth_m * omega,
    ]
    return A, density, C, R, np.diag(spread[:size]) ** 2


def oscillator(noise: Noise, sd: float) -> tuple[Array, Array]:
    """Return system matrix and process density (2, 2) of a signal in the band of the waves.

    ``sd`` is the standard deviation of the signal, the first state; the second is its rate.
    """
    omega, damping = 2.0 * math.pi * noise.wave_frequency_hz, noise.wave_damping
    A = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]])
    return A, np.diag([0.0, 4.0 * damping * omega**3 * sd**2])


def whiten_columns(block: Array, noise_filter: Filter) -> Array:
    """Return a block (samples, outputs, columns) with each column whitened as a residual."""
    return whiten_block(
        np.ascontiguousarray(block),
        noise_filter.transitions,
        noise_filter.hold,
        noise_filter.output,
        noise_filter.gains,
        noise_filter.whiteners,
    )


def whiten_residual(residual: Array, noise_filter: Filter) -> Array:
    """Return the normalised innovations of a residual (samples, outputs)."""
    return whiten(
        residual,
        noise_filter.transitions,
        noise_filter.hold,
        noise_filter.output,
        noise_filter.gains,
        noise_filter.whiteners,
    )


def cost(residuals: Sequence[Array], noise_filter: Filter) -> float:
    """Return the negative log-likelihood of the residuals without constants."""
    # 1/2 sum over samples of (innovation^T innovation + log det S).
    return sum(
        0.5
        * float(
            np.sum(whiten_residual(r, noise_filter) ** 2) + np.sum(noise_filter.log_dets[: len(r)])
        )
        for r in residuals
    )


class _CandidateLevels(NamedTuple):
    """Innovations for candidate noise levels, all runs concatenated."""

    innovations: Array
    log_scales: Array
    """Logarithm of the whitener's diagonal for each innovation."""
    cost: float
    """Negative log-likelihood plus the term of the prior ``PRIOR_LOG_SD``."""


def estimate(plane: LinearPlane, residuals: Sequence[Array], dt: float, start: Noise) -> Noise:
    """Return the maximum a posteriori noise levels for residuals (samples, outputs) of runs.

    The prior is log-normal about the default levels with ``PRIOR_LOG_SD``. ``dt`` is the sample
    interval (s), ``start`` the initial guess. The pressure of waves is in the result if ``start``
    has it or the residuals show it by ``WAVE_DEPTH_EVIDENCE``.
    """
    without = _estimate_levels(plane, residuals, dt, start)
    if "depth" not in plane.states or start.wave_depth_m > 0.0:
        return without.noise
    trial = without.noise._replace(wave_depth_m=WAVE_DEPTH_M)
    samples = max(len(r) for r in residuals)
    likelihoods = [cost(residuals, build(plane, n, dt, samples)) for n in (without.noise, trial)]
    if likelihoods[1] > likelihoods[0]:
        return without.noise
    with_waves = _estimate_levels(plane, residuals, dt, trial)
    is_evident = with_waves.cost < without.cost - WAVE_DEPTH_EVIDENCE
    return with_waves.noise if is_evident else without.noise


class _EstimatedLevels(NamedTuple):
    """Noise levels and the negative log posterior."""

    noise: Noise
    cost: float


def _estimate_levels(
    plane: LinearPlane, residuals: Sequence[Array], dt: float, start: Noise
) -> _EstimatedLevels:
    """Return the maximum a posteriori levels of the disturbances that ``start`` has."""
    # Fisher scoring on lambda = log of the levels. With innovations n(lambda) and log scales
    # l(lambda), D = dn/dlambda and B = dl/dlambda:
    #     gradient = D^T n - sum B + prior,   information = D^T D + B^T B + prior
    # (Gupta and Mehra 1974, IEEE Trans. AC 19, eq. 32, for a triangular root).
    present = Noise._fields.index("test_depth_m" if start.wave_depth_m > 0.0 else "wave_depth_m")
    samples = max(len(r) for r in residuals)
    mean = np.log(Noise(wave_depth_m=WAVE_DEPTH_M)[:present])
    sd = np.array(PRIOR_LOG_SD[:present])
    precision = 1.0 / sd**2
    lowest, highest = mean - 4.0 * sd, mean + 4.0 * sd
    lowest[Noise._fields.index("depth_m")] = math.log(MIN_DEPTH_NOISE_M)

    def noise_of(levels: Array) -> Noise:
        """Return the noise with the levels that are present; the others are zero."""
        return Noise(*(float(level) for level in np.exp(levels)))

    def evaluate(levels: Array) -> _CandidateLevels:
        """Return the negative log posterior at the logarithms of the levels, and its terms."""
        noise_filter = build(plane, noise_of(levels), dt, samples)
        innovations = np.concatenate([whiten_residual(r, noise_filter).ravel() for r in residuals])
        scales = np.log(np.diagonal(noise_filter.whiteners, axis1=1, axis2=2))
        log_scales = np.concatenate([scales[: len(r)].ravel() for r in residuals])
        deviation = levels - mean
        likelihood_cost = 0.5 * float(innovations @ innovations) - float(np.sum(log_scales))
        return _CandidateLevels(
            innovations,
            log_scales,
            likelihood_cost + 0.5 * float(deviation @ (precision * deviation)),
        )

    levels = np.clip(np.log(start[:present]), lowest, highest)
    current = evaluate(levels)
    for _ in range(MAX_SCORING_STEPS):
        step, predicted_decrease = _scoring_step(
            evaluate, current, levels, precision * (levels - mean), precision, (lowest, highest)
        )
        if predicted_decrease < MIN_IMPROVEMENT:
            break
        while (
            candidate := evaluate(levels + step)
        ).cost > current.cost and predicted_decrease > MIN_IMPROVEMENT:
            step, predicted_decrease = 0.3 * step, 0.3 * predicted_decrease
        if candidate.cost > current.cost:
            break
        levels, current = levels + step, candidate
    return _EstimatedLevels(noise_of(levels), current.cost)


def _scoring_step(
    evaluate: Callable[[Array], _CandidateLevels],
    current: _CandidateLevels,
    levels: Array,
    prior_gradient: Array,
    precision: Array,
    bounds: tuple[Array, Array],
) -> tuple[Array, float]:
    """Return a step within the bounds and the decrease of the cost that it predicts."""
    # D = dn/dlambda and B = dl/dlambda by forward differences; gradient g and information I as in
    # ``estimate``. Step = -I^-1 g in the levels that are not at a bound, limited to a factor e;
    # predicted decrease = -(g . step + 1/2 step . I step).
    perturbed = [evaluate(levels + DIFFERENCE * unit) for unit in np.eye(levels.size)]
    D = np.column_stack([(m.innovations - current.innovations) / DIFFERENCE for m in perturbed])
    B = np.column_stack([(m.log_scales - current.log_scales) / DIFFERENCE for m in perturbed])
    gradient = D.T @ current.innovations - np.sum(B, axis=0) + prior_gradient
    information = D.T @ D + B.T @ B + np.diag(precision)
    lowest, highest = bounds
    free = ~(((levels <= lowest) & (gradient > 0.0)) | ((levels >= highest) & (gradient < 0.0)))
    step = np.zeros(levels.size)
    step[free] = -np.linalg.solve(information[np.ix_(free, free)], gradient[free])
    step = np.clip(levels + np.clip(step, -1.0, 1.0), lowest, highest) - levels
    return step, -float(gradient @ step + 0.5 * step @ information @ step)
