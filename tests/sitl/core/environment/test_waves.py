"""Drawn wave components; ``tests/reference/cases/waves.py`` checks their kinematics."""

import math

import numpy as np
import pytest
from numpy.random import default_rng

from sitl.core.environment import waves
from sitl.core.environment.waves import AMPLITUDE, FREQUENCY, NORTH, NUMBER, WEST
from sitl.environment_schema import Waves

G = 9.81
SPREAD = Waves(
    significant_height_m=1.0, peak_period_s=6.0, from_deg=200.0, spreading=8.0, components=200
)


def swell(sea: Waves, depth_m: float = 200.0) -> waves.Swell:
    built = waves.build(sea, depth_m, G)
    assert built is not None
    return built


@pytest.mark.parametrize(("depth_m", "omega"), [(200.0, 1.0), (5.0, 1.0), (2.0, 0.3), (30.0, 4.0)])
def test_wave_number_satisfies_dispersion_relation(depth_m: float, omega: float) -> None:
    k = waves.wave_number_pm(omega, depth_m, G)
    assert G * k * math.tanh(k * depth_m) == pytest.approx(omega**2, rel=1e-12)


@pytest.mark.parametrize("spectrum", ["pierson-moskowitz", "jonswap"])
def test_components_have_energy_and_mean_frequency(spectrum: str) -> None:
    """Reference: m_1 / m_0 by quadrature of the formula printed in DNV-RP-C205."""
    sea = Waves(spectrum=spectrum, significant_height_m=2.0, peak_period_s=8.0)  # type: ignore[arg-type]
    drawn, peak = swell(sea), 2.0 * math.pi / 8.0
    assert 4.0 * math.sqrt(np.sum(drawn.amplitude_m**2) / 2.0) == pytest.approx(2.0, rel=1e-12)
    omega = np.linspace(0.2 * peak, 20.0 * peak, 400_000)
    density = 5 / 16 * 2.0**2 * peak**4 * omega**-5 * np.exp(-1.25 * (omega / peak) ** -4)
    if spectrum == "jonswap":
        sigma = np.where(omega <= peak, 0.07, 0.09)
        density *= (1 - 0.287 * math.log(3.3)) * 3.3 ** np.exp(
            -0.5 * ((omega - peak) / (sigma * peak)) ** 2
        )
    step = omega[1] - omega[0]
    assert 4.0 * math.sqrt(density.sum() * step) == pytest.approx(2.0, rel=0.01)
    mean = (density * omega).sum() / density.sum()
    assert np.mean(drawn.frequency_radps) == pytest.approx(mean, rel=0.005)


def test_fully_developed_sea_needs_no_period() -> None:
    """Fossen 2021, sec. 10.2: omega_0 = 0.4 sqrt(g / H_s)."""
    sea = Waves(spectrum="pierson-moskowitz", significant_height_m=3.0)
    same = Waves(
        spectrum="pierson-moskowitz",
        significant_height_m=3.0,
        peak_period_s=5 * math.pi / math.sqrt(G / 3),
    )
    np.testing.assert_allclose(swell(sea).frequency_radps, swell(same).frequency_radps, rtol=1e-12)


def test_wave_directions_follow_spreading_function() -> None:
    """The mean of cos(angle) of the distribution cos^2s(angle/2) is s / (s + 1)."""
    drawn = waves.draw_components(swell(SPREAD), default_rng(1))
    towards = np.arctan2(-drawn[:, WEST], drawn[:, NORTH])
    off = towards - math.radians(20.0)
    assert np.mean(np.cos(off)) == pytest.approx(8.0 / 9.0, abs=0.005)
    assert np.mean(np.sin(off)) == pytest.approx(0.0, abs=0.01)
    np.testing.assert_allclose(np.hypot(drawn[:, NORTH], drawn[:, WEST]), drawn[:, NUMBER])


def test_wave_components_depend_on_seed_only() -> None:
    first, again, other = (
        waves.draw_components(swell(SPREAD), default_rng(seed)) for seed in (4, 4, 5)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    np.testing.assert_array_equal(
        first[:, [FREQUENCY, AMPLITUDE]], other[:, [FREQUENCY, AMPLITUDE]]
    )


def test_wave_velocity_at_floor_and_above_surface() -> None:
    shallow = waves.draw_components(swell(SPREAD, 6.0), default_rng(2))
    assert waves.motion(shallow, 3.0, 4.0, -6.0, 7.0).velocity[2] == pytest.approx(0.0, abs=1e-12)
    at_level = waves.motion(shallow, 3.0, 4.0, 0.0, 7.0)
    assert waves.motion(shallow, 3.0, 4.0, 0.4, 7.0) == at_level
    assert at_level.head_m == pytest.approx(at_level.elevation_m, rel=1e-12)


def test_zero_wave_height_gives_no_components() -> None:
    assert waves.build(Waves(), 20.0, G) is None
