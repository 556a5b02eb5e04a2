"""Theil's coefficient against closed forms, and the noise floor against simulated disturbances."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.vehicle import config
from sysid.data.runs import Run
from sysid.estimation.map import steady_state
from sysid.estimation.map.datasets import STEP_S, STRIDE
from sysid.models import parameters, prediction
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES
from sysid.planes import PLANES, Plane
from sysid.validation import noise_floor
from tests.sysid import sea


class TheilTestCase:
    def test_equal_series(self) -> None:
        y = np.sin(np.arange(50.0))
        assert noise_floor.theil(y, y).coefficient == 0.0

    def test_opposite_series_have_no_likeness(self) -> None:
        y = np.sin(np.arange(50.0))
        found = noise_floor.theil(y, -y)
        assert found.coefficient == pytest.approx(1.0)

    def test_an_offset_is_bias_alone(self) -> None:
        y = np.sin(np.arange(50.0))
        found = noise_floor.theil(y, y + 0.5)
        assert found.bias_share == pytest.approx(1.0)
        expected = 0.5 / (math.sqrt(np.mean(y**2)) + math.sqrt(np.mean((y + 0.5) ** 2)))
        assert found.coefficient == pytest.approx(expected)

    def test_a_factor_is_variance_alone(self) -> None:
        y = np.sin(np.arange(50.0))
        y -= np.mean(y)
        found = noise_floor.theil(y, 1.5 * y)
        assert found.variance_share == pytest.approx(1.0)
        assert found.coefficient == pytest.approx(0.2), "0.5 rms over 1 rms and 1.5 rms"

    @given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=3, max_size=30))
    def test_the_shares_make_a_whole(self, pairs: list[tuple[float, float]]) -> None:
        y, simulated = np.array(pairs).T
        if np.mean((y - simulated) ** 2) < 1e-6:
            return
        found = noise_floor.theil(y, simulated)
        rho = np.mean((y - y.mean()) * (simulated - simulated.mean()))
        unlike = 2.0 * (y.std() * simulated.std() - rho) / np.mean((y - simulated) ** 2)
        assert found.bias_share + found.variance_share + found.covariance_share == pytest.approx(
            1.0
        )
        assert found.covariance_share == pytest.approx(unlike, abs=1e-6)
        assert 0.0 <= found.coefficient <= 1.0 + 1e-12


SENSORS = sea.Sensors(gyro_bias_radps=0.0)
KNOWN_SEA = Noise(
    rate_radps=SENSORS.rate_radps / math.sqrt(STRIDE),
    angle_rad=SENSORS.angle_rad / math.sqrt(STRIDE),
    depth_m=0.01,
    slow_radps2=sea.SLOW_RADPS2,
    slow_time_s=3.0,
    wave_radps2=sea.WAVE_RADPS2,
    wave_frequency_hz=0.15,
    wave_damping=0.1,
    force_mps15=1e-4,
)
"""Disturbance of ``tests.sysid.sea`` at level 1, as noise levels of the model."""


@pytest.mark.parametrize(("plane", "seconds"), [("yaw", 20.0), ("pitch", 8.0)])
def test_noise_floor_matches_perfect_model(
    plane: Plane, seconds: float, bench: config.VehicleConfig
) -> None:
    """The simulated vehicle is the model: mean and standard deviation of the mean square agree.

    The step is small, because quadratic damping in a tight turn reduces the response to
    disturbances.
    """
    vehicle = parameters.candidate_vehicle(bench, dict.fromkeys(PLANES, 0.0), np.zeros(len(NAMES)))
    signal = sea.step(0.3, seconds)
    runs = [sea.fly(bench, plane, signal, seed=seed, sensors=SENSORS) for seed in range(60)]
    errors = [_mean_square(vehicle, run) for run in runs]
    samples = int(np.count_nonzero(~runs[0].preroll)) // STRIDE
    linear = steady_state.linear_plane(vehicle, plane)
    floor = noise_floor.noise_floor_of(
        noise_floor.rate_covariance(
            linear, KNOWN_SEA, STEP_S, round(prediction.LEAD_S / STEP_S), samples
        )
    )
    assert np.mean(errors) == pytest.approx(floor.mean_deg2ps2, rel=0.25)
    assert np.std(errors) == pytest.approx(floor.sd_deg2ps2, rel=0.4)


def _mean_square(vehicle: parameters.CandidateVehicle, run: Run) -> float:
    """Mean squared rate error at 10 Hz, (deg/s)^2, simulated as predictions are."""
    predicted_run = run.since(-prediction.LEAD_S)
    errors_degps = np.degrees(
        predicted_run.rate_radps - prediction.simulate(vehicle, predicted_run).rate_radps
    )[~predicted_run.preroll]
    whole = errors_degps.size // STRIDE * STRIDE
    return float(np.mean(errors_degps[:whole].reshape(-1, STRIDE).mean(axis=1) ** 2))


def test_floor_from_repeats_matches_sample_variance(bench: config.VehicleConfig) -> None:
    runs = [sea.fly(bench, Plane.YAW, sea.step(3.0, 20.0), seed=seed) for seed in range(12)]
    others = [replace(run, magnitude_deg=-3.0) for run in runs[:1]]
    floor = noise_floor.floor_from_repeats_deg2ps2([*runs, *others])
    rates = np.array([np.degrees(run.rate_radps[~run.preroll]) for run in runs])
    assert floor == pytest.approx(float(np.mean(np.var(rates, axis=0, ddof=1))), rel=1e-9)
    assert noise_floor.floor_from_repeats_deg2ps2([runs[0], *others]) is None
