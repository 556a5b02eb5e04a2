"""The whitening filter against samples of its own process, and against a dense covariance."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from sysid.models import linear_planes, noise
from sysid.models.noise import Noise
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED

DT = 0.1
PLANES = {
    "yaw": linear_planes.yaw_plane(TABLE_1_ADJUSTED),
    "pitch": linear_planes.pitch_plane(TABLE_1_ADJUSTED),
}


def draw(
    plane: linear_planes.LinearPlane, level: Noise, samples: int, rng: np.random.Generator
) -> np.ndarray:
    """Return residuals simulated with a twentieth of the filter's step."""
    A, density, C, R, P0 = noise.system(plane, level)
    fine = 20
    h = DT / fine
    Phi = expm(A * h)
    root = np.sqrt(np.diag(density) * h)
    x = np.sqrt(np.diag(P0)) * rng.standard_normal(A.shape[0])
    out = np.empty((samples, C.shape[0]))
    for k in range(samples):
        out[k] = C @ x + np.sqrt(np.diag(R)) * rng.standard_normal(C.shape[0])
        for _ in range(fine):
            x = Phi @ x + root * rng.standard_normal(x.size)
    return out


@pytest.mark.parametrize("name", ["yaw", "pitch"])
def test_innovations_white_with_unit_variance(name: str) -> None:
    rng = np.random.default_rng(7)
    plane, level = PLANES[name], Noise()
    by = noise.build(plane, level, DT, 400)
    white = np.stack([noise.whiten_residual(draw(plane, level, 400, rng), by) for _ in range(12)])
    n = white.shape[0] * white.shape[1]
    for output in range(white.shape[2]):
        series = white[:, :, output]
        # Tolerance: four standard deviations of the estimates.
        assert np.var(series) == pytest.approx(1.0, abs=4 * math.sqrt(2 / n))
        for lag in (1, 3, 10, 60):
            assert abs(np.mean(series[:, lag:] * series[:, :-lag])) < 4 / math.sqrt(n)
        for other in range(output):
            assert abs(np.mean(series * white[:, :, other])) < 4 / math.sqrt(n)


@pytest.mark.parametrize("name", ["yaw", "pitch"])
def test_filter_along_equal_segments_is_the_constant_filter(name: str) -> None:
    plane, level, samples = PLANES[name], Noise(), 123
    constant = noise.build(plane, level, DT, samples)
    along = noise.build_along([plane] * 13, level, DT, samples, hold=10)
    residual = draw(plane, level, samples, np.random.default_rng(8))
    # The constant filter is stationary once its gain changes by less than 1e-7.
    np.testing.assert_allclose(
        noise.whiten_residual(residual, along),
        noise.whiten_residual(residual, constant),
        rtol=1e-4,
        atol=1e-4,
    )


def test_filter_along_a_turn_is_that_of_the_dense_covariance() -> None:
    """Reference: likelihood by the dense covariance of a plane that is damped more from 1 s on."""
    straight, level, samples, hold = PLANES["yaw"], Noise(), 25, 10
    damped = straight._replace(A=straight.A + np.diag([-1.0, -2.0, 0.0]))
    along = noise.build_along([straight, damped, damped], level, DT, samples, hold)
    _, density, C, R, P0 = noise.system(straight, level)
    steps = [noise.discrete(noise.system(p, level)[0], density, DT) for p in (straight, damped)]
    # x = L xi, with xi the initial state and the process noise of all samples.
    n = len(P0)
    rows = [np.hstack([np.eye(n), np.zeros((n, n * (samples - 1)))])]
    blocks = [P0]
    for k in range(1, samples):
        transition, process = steps[min((k - 1) // hold, 1)]
        row = transition @ rows[-1]
        row[:, n * k : n * (k + 1)] = np.eye(n)
        rows.append(row)
        blocks.append(process)
    covariance = np.zeros((n * samples, n * samples))
    for k, block in enumerate(blocks):
        covariance[n * k : n * (k + 1), n * k : n * (k + 1)] = block
    observed = np.vstack([C @ row for row in rows])
    S = observed @ covariance @ observed.T + np.kron(np.eye(samples), R)
    residual = np.linalg.cholesky(S) @ np.random.default_rng(9).standard_normal(len(S))
    white = noise.whiten_residual(residual.reshape(samples, -1), along)
    assert np.sum(white**2) == pytest.approx(residual @ np.linalg.solve(S, residual), rel=1e-8)
    assert np.sum(along.log_dets) == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-10)


def test_cost_equals_gaussian_likelihood() -> None:
    """Reference: dense covariance of a short record, without a filter."""
    plane, level, samples = PLANES["yaw"], Noise(), 25
    A, density, C, R, P0 = noise.system(plane, level)
    n, steps = A.shape[0], 400
    h = DT / steps
    Phi_h, Phi = expm(A * h), expm(A * DT)
    Q = np.zeros((n, n))
    for _ in range(steps):
        Q = Phi_h @ Q @ Phi_h.T + density * h
    P, covariances = P0, [P0]
    for _ in range(samples):
        P = Phi @ P @ Phi.T + Q
        covariances.append(P)
    dense = np.zeros((2 * samples, 2 * samples))
    for i in range(samples):
        for j in range(i + 1):
            block = C @ np.linalg.matrix_power(Phi, i - j) @ covariances[j] @ C.T + (
                R if i == j else 0.0
            )
            dense[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = block
            dense[2 * j : 2 * j + 2, 2 * i : 2 * i + 2] = block.T
    residual = draw(plane, level, samples, np.random.default_rng(3))
    y = residual.ravel()
    expected = 0.5 * (y @ np.linalg.solve(dense, y) + np.linalg.slogdet(dense)[1])
    assert noise.cost([residual], noise.build(plane, level, DT, samples)) == pytest.approx(
        expected, rel=1e-3
    )


def test_estimate_recovers_true_noise_levels() -> None:
    rng = np.random.default_rng(5)
    plane = PLANES["yaw"]
    truth = Noise(rate_radps=0.004, slow_radps2=0.008, wave_radps2=0.012, wave_frequency_hz=0.17)
    records = [draw(plane, truth, 400, rng) for _ in range(6)]
    found = noise.estimate(plane, records, DT, Noise())
    assert found.rate_radps == pytest.approx(truth.rate_radps, rel=0.1)
    assert found.slow_radps2 == pytest.approx(truth.slow_radps2, rel=0.35)
    assert found.wave_radps2 == pytest.approx(truth.wave_radps2, rel=0.35)
    assert found.wave_frequency_hz == pytest.approx(truth.wave_frequency_hz, rel=0.08)


def test_angle_that_is_the_integral_of_the_rate_leaves_disturbances_unchanged() -> None:
    """As an autopilot logs them: the gyro's noise is in both, and the angle is smooth."""
    rng, plane, noisy_radps = np.random.default_rng(6), PLANES["yaw"], math.radians(0.022)
    truth = Noise(rate_radps=0.0, angle_rad=0.0)
    records = [draw(plane, truth, 400, rng) for _ in range(12)]
    for record in records:
        gyro = noisy_radps * rng.standard_normal(len(record))
        record[:, 0] += gyro
        record[:, 1] += DT * np.cumsum(gyro) - 0.01 * record[:, 0]
    found = noise.estimate(plane, records, DT, Noise())
    assert found.slow_time_s == pytest.approx(truth.slow_time_s, rel=0.25)
    assert found.slow_radps2 == pytest.approx(truth.slow_radps2, rel=0.25)
    assert found.rate_radps == pytest.approx(noisy_radps, rel=0.1)


def swell_depths_m(sd_m: float, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Return the depth error by a swell of periods about 6 s: a sum of sines."""
    time_s, frequencies_hz = DT * np.arange(samples), rng.uniform(0.14, 0.19, 15)
    phases = rng.uniform(0.0, 2.0 * math.pi, (15, 1))
    waves = np.sin(2.0 * math.pi * frequencies_hz[:, None] * time_s + phases)
    return np.asarray(sd_m * math.sqrt(2.0 / 15.0) * waves.sum(axis=0))


def test_estimate_finds_pressure_of_waves() -> None:
    rng, plane = np.random.default_rng(6), PLANES["pitch"]
    records = [draw(plane, Noise(), 400, rng) for _ in range(6)]
    for record in records:
        record[:, 2] += swell_depths_m(0.02, 400, rng)
    found = noise.estimate(plane, records, DT, Noise())
    # A record of 40 s holds about six independent amplitudes of such a narrow band.
    assert found.wave_depth_m == pytest.approx(0.02, rel=0.25)
    assert found.force_mps15 == pytest.approx(Noise().force_mps15, rel=0.35)


@pytest.mark.parametrize("seed", range(5))
def test_estimate_without_waves_has_no_pressure(seed: int) -> None:
    rng, plane = np.random.default_rng(seed), PLANES["pitch"]
    records = [draw(plane, Noise(), 400, rng) for _ in range(4)]
    assert noise.estimate(plane, records, DT, Noise()).wave_depth_m == 0.0


def test_waves_decay_with_depth_as_airy_says() -> None:
    """A wave of 6 s is 56.2 m long: over 56.2 / 2 pi m of depth its motion falls to 1 / e."""
    level = Noise(wave_frequency_hz=1.0 / 6.0, wave_depth_m=0.02, test_depth_m=2.0)
    deep = noise.at_depth({Plane.PITCH: level}, 2.0 + 56.2 / (2.0 * math.pi))[Plane.PITCH]
    assert deep.wave_depth_m == pytest.approx(0.02 / math.e, rel=1e-3)
    assert deep.wave_radps2 == pytest.approx(level.wave_radps2 / math.e, rel=1e-3)
    assert deep.slow_radps2 == level.slow_radps2


def test_noise_without_waves_is_equal_at_all_depths() -> None:
    levels = {Plane.YAW: Noise(), Plane.PITCH: Noise(test_depth_m=8.0)}
    assert noise.at_depth(levels, 1.0) == levels
