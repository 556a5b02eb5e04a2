"""The current: layers, and the statistics of its variation."""

import math

import numpy as np
import pytest

from sitl.core import plant
from sitl.core.draws import AT_START, PER_TICK
from sitl.core.environment import current
from sitl.environment_schema import CurrentConfig, CurrentLayer, Variation

TICK_S = 0.02
LAYERS = (
    CurrentLayer(depth_m=2.0, speed_mps=0.4, towards_deg=90.0),
    CurrentLayer(depth_m=6.0, speed_mps=0.2, towards_deg=0.0),
)


@pytest.mark.parametrize(
    ("depth_m", "north", "west"),
    [
        (0.0, 0.0, -0.4),
        (2.0, 0.0, -0.4),
        (3.0, 0.05, -0.3),
        (4.0, 0.1, -0.2),
        (6.0, 0.2, 0.0),
        (50.0, 0.2, 0.0),
    ],
)
def test_current_layers_are_interpolated_linearly(
    depth_m: float, north: float, west: float
) -> None:
    profile = current.profile(CurrentConfig(layer=LAYERS))
    assert current.steady_current(profile, -depth_m)[:2] == pytest.approx((north, west), abs=1e-15)


@pytest.mark.parametrize("depth_m", [1.0, 3.0, 5.5, 8.0])
def test_shear_is_derivative_of_velocity_by_height(depth_m: float) -> None:
    profile = current.profile(CurrentConfig(layer=LAYERS))
    north, west = (
        (above - below) / 2e-3
        for above, below in zip(
            current.steady_current(profile, -depth_m + 1e-3)[:2],
            current.steady_current(profile, -depth_m - 1e-3)[:2],
            strict=True,
        )
    )
    assert current.steady_current(profile, -depth_m)[2:] == pytest.approx((north, west), abs=1e-12)


def test_steady_current_has_direction_at_every_depth() -> None:
    profile = current.profile(CurrentConfig(speed_mps=0.5, towards_deg=30.0))
    for z_m in (0.0, -5.0, -500.0):
        north, west, *shear = current.steady_current(profile, z_m)
        assert (north, west) == pytest.approx((0.5 * math.cos(math.pi / 6), -0.25))
        assert shear == [0.0, 0.0]


def test_variation_has_rms_correlation_and_acceleration() -> None:
    """The autocorrelation is (1 + omega t) exp(-omega t), 1/e at the time constant."""
    drift = current.current_drift(Variation(rms_mps=0.1, time_constant_s=2.0), TICK_S)
    draws = plant.random_streams(3).draws
    draws.prepare(AT_START)
    variation = np.array(current.sample_stationary(drift, draws))
    velocity, rate = [], []
    for _ in range(400_000):
        draws.prepare(PER_TICK)
        current.advance(drift, variation, draws.table)
        velocity_mps, rate_mps2 = current.variation_motion(drift, variation)
        velocity.append(velocity_mps)
        rate.append(rate_mps2)
    v, a = np.array(velocity), np.array(rate)
    assert v.std(axis=0)[:2] == pytest.approx([0.1, 0.1], rel=0.03)
    assert (v[:, 2] == 0.0).all()
    for seconds, correlation in ((0.5, 0.897), (2.0, math.exp(-1.0)), (4.0, 0.0725)):
        lag = round(seconds / TICK_S)
        found = [np.mean(v[lag:, i] * v[:-lag, i]) / np.mean(v[:, i] ** 2) for i in range(2)]
        assert np.mean(found) == pytest.approx(correlation, abs=0.03)
    assert abs(np.corrcoef(v[:, 0], v[:, 1])[0, 1]) < 0.03
    gained = TICK_S * 0.5 * (a[1:] + a[:-1])
    assert np.std(np.diff(v, axis=0)[:, :2] - gained[:, :2]) < 0.1 * np.std(gained[:, :2])


def test_without_rms_there_is_no_variation() -> None:
    assert current.current_drift(Variation(), TICK_S).rms_mps == 0.0
