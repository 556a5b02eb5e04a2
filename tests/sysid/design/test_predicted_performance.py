"""Predicted statistics against a simulation in time that uses no spectrum."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import iirpeak, lfilter

from sysid.control_analysis import loop_state_space
from sysid.design import design_model
from sysid.design.disturbance_response import predict_response
from sysid.design.pid import DesignRobustness, Spec, predicted_performance
from sysid.models.model_file import IdentifiedModel, NoiseModel, sha256_of_model
from sysid.monitor.performance_spec import AVERAGED_S, RESONANCE_BANDWIDTH, PerformanceBaseline
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_3_IMPROVED

Array = NDArray[np.float64]

STEP_S, LASTS_S = 0.1, 20_000.0


@pytest.fixture(scope="module")
def baseline(model: IdentifiedModel) -> PerformanceBaseline:
    robustness = DesignRobustness(0.9, 1.0, "", 240)
    return predicted_performance.performance_baseline(
        model, design_model.from_model(model), TABLE_3_IMPROVED, Spec(), robustness
    )


@pytest.fixture(scope="module")
def heading_deg(model: IdentifiedModel) -> Array:
    """Return the simulated heading (deg) in closed loop with disturbance and sensor noise."""
    vehicle = design_model.from_model(model)
    closed = loop_state_space.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, TABLE_3_IMPROVED)
    rng, sea = np.random.default_rng(5), vehicle.disturbance[Plane.YAW]
    pushed = disturbance(sea, rng, round(LASTS_S / STEP_S))
    moment = np.zeros(len(closed.A))
    moment[: vehicle.planes.yaw.moment.size] = vehicle.planes.yaw.moment
    whole = expm(np.block([[closed.A, moment[:, None]], [np.zeros((1, len(moment) + 1))]]) * STEP_S)
    x, headings_rad = np.zeros(len(moment)), []
    for push in pushed:
        x = whole[:-1, :-1] @ x + whole[:-1, -1] * push
        headings_rad.append(x[2])
    return np.degrees(headings_rad) + rng.normal(0.0, sea.angle_noise_deg, len(headings_rad))


def disturbance(sea: NoiseModel, rng: np.random.Generator, count: int) -> Array:
    """Return slow plus narrow-band angular acceleration (rad/s^2) by differential equations."""
    fine, dt = 10, STEP_S / 10
    keep = math.exp(-dt / sea.slow_time_s)
    slow = lfilter([math.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(count * fine))
    omega = 2.0 * math.pi * sea.wave_frequency_hz
    A = np.array([[0.0, 1.0], [-(omega**2), -2.0 * sea.wave_damping * omega]])
    step, push = expm(A * dt), math.sqrt(4.0 * sea.wave_damping * omega**3 * dt)
    poles = np.poly(step)
    wave = lfilter([0.0, 0.0, push * step[0, 1]], poles, rng.standard_normal(count * fine))
    both = sea.slow_accel_degps2 * slow + sea.wave_accel_degps2 * wave
    return np.asarray(np.radians(both[::fine]))


def test_rms_and_means_simulation_equals_prediction(
    baseline: PerformanceBaseline, heading_deg: Array
) -> None:
    expected, whole = baseline.predicted["heading_deg"], round(AVERAGED_S / STEP_S)
    averages = heading_deg[: heading_deg.size // whole * whole].reshape(-1, whole).mean(axis=1)
    assert np.std(heading_deg) == pytest.approx(expected.rms, rel=0.1)
    assert np.std(averages) == pytest.approx(expected.mean_sd_20s, rel=0.15)
    assert np.quantile(np.abs(heading_deg), 0.95) == pytest.approx(expected.p95, rel=0.1)


def test_variance_spread_follows_correlation_time(
    baseline: PerformanceBaseline, heading_deg: Array
) -> None:
    """Chi-square: the relative variance of a variance over T is 2 correlation_time_s / T."""
    expected, whole = baseline.predicted["heading_deg"], round(AVERAGED_S / STEP_S)
    variances = heading_deg[: heading_deg.size // whole * whole].reshape(-1, whole).var(axis=1)
    spread = np.var(variances) / np.mean(variances) ** 2
    assert spread == pytest.approx(2.0 * expected.correlation_time_s / AVERAGED_S, rel=0.3)


def test_resonance_rms_simulation_equals_prediction(
    baseline: PerformanceBaseline, heading_deg: Array
) -> None:
    band = iirpeak(
        baseline.heading_resonance_radps, 1.0 / RESONANCE_BANDWIDTH, fs=2.0 * math.pi / STEP_S
    )
    assert np.std(lfilter(*band, heading_deg)) == pytest.approx(
        baseline.predicted["heading_resonance_deg"].rms, rel=0.1
    )


def test_predicted_surface_rms_contains_the_gyro_noise_above_the_grid(
    baseline: PerformanceBaseline, model: IdentifiedModel
) -> None:
    response = predict_response(design_model.from_model(model), TABLE_3_IMPROVED)
    assert baseline.predicted["rudder_deg"].rms == pytest.approx(response.rudder_deg, rel=1e-6)
    assert baseline.predicted["elevator_deg"].rms == pytest.approx(response.elevator_deg, rel=1e-6)


def test_predicted_means_are_those_of_level_flight(
    baseline: PerformanceBaseline, model: IdentifiedModel
) -> None:
    bias, level = model.planes[Plane.YAW].actuator_bias_deg, model.vehicle
    assert baseline.predicted["rudder_deg"].mean == -bias.value
    assert baseline.predicted["pitch_deg"].mean == level.level_pitch_deg
    assert baseline.predicted["pitch_deg"].mean_sd > 0.0
    assert baseline.model_sha256 == sha256_of_model(model)
    assert baseline.robustness is not None
    assert (baseline.robustness.specification, baseline.robustness.vehicles) == (0.9, 240)
