"""Whiteness tests: false alarm rate for white noise, and detection of coloured noise."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.signal import lfilter

from sysid.validation.whiteness import (
    combined_p,
    cumulative_periodogram,
    kolmogorov_p,
    whiteness,
)

DT_S = 0.1
SERIES = 1500


def coloured(rng: np.random.Generator, samples: int, memory: float) -> NDArray[np.float64]:
    """A first-order autoregression of unit variance."""
    series = lfilter(
        [np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(samples + 200)
    )[200:]
    return np.asarray(series, dtype=np.float64)


@pytest.mark.parametrize("samples", [81, 200])
def test_whiteness_white_noise_false_alarm_rate(samples: int) -> None:
    """Level 5 %; the sampling error of 1500 series is 0.6 %."""
    rng = np.random.default_rng(1)
    results = [whiteness(rng.standard_normal(samples), DT_S) for _ in range(SERIES)]
    alarms = np.mean([result.periodogram_p < 0.05 for result in results if result])
    assert 0.032 < alarms < 0.068
    portmanteau = np.mean([result.ljung_box_p < 0.05 for result in results if result])
    assert 0.03 < portmanteau < 0.085, "chi-square is approximate for short series"
    assert np.mean([result.mean_square for result in results if result]) == pytest.approx(
        1.0, abs=0.02
    )


@pytest.mark.parametrize("memory", [0.45, -0.45])
def test_whiteness_coloured_noise_is_detected(memory: float) -> None:
    rng = np.random.default_rng(2)
    results = [whiteness(coloured(rng, 200, memory), DT_S) for _ in range(200)]
    assert np.mean([result.periodogram_p < 0.05 for result in results if result]) > 0.95
    assert np.mean([result.ljung_box_p < 0.05 for result in results if result]) > 0.9


def test_cumulative_periodogram_steps_at_a_tone() -> None:
    n = 256
    tone = np.sin(2.0 * np.pi * 32 * np.arange(n) / n)
    rising = cumulative_periodogram(tone)
    assert rising.size == (n - 1) // 2 - 1
    np.testing.assert_allclose(rising[:31], 0.0, atol=1e-12)
    np.testing.assert_allclose(rising[31:], 1.0, atol=1e-12)


def test_whiteness_short_series_gives_none() -> None:
    assert whiteness(np.ones(20), DT_S) is None


@pytest.mark.parametrize("samples", [19, 100, 300, 2000])
@pytest.mark.parametrize("scaled", [0.3, 0.7, 1.0, 1.6, 1.99, 2.01, 3.0])
def test_kolmogorov_p_matches_scipy(samples: int, scaled: float) -> None:
    """Reference: scipy.stats, whose series for n > 140 has errors of 1.4e-6; scaled: sqrt(n) D."""
    distance, tolerance = scaled / samples**0.5, 1e-9 if samples <= 140 else 3e-6
    expected = stats.kstwo.sf(distance, samples)
    assert kolmogorov_p(distance, samples) == pytest.approx(expected, rel=tolerance)


def test_whiteness_distance_matches_kstest() -> None:
    series = np.random.default_rng(2).standard_normal(201)
    found = whiteness(series, DT_S)
    assert found is not None
    expected = stats.kstest(cumulative_periodogram(series - np.mean(series)), "uniform")
    assert found.distance == pytest.approx(expected.statistic, rel=1e-12)
    assert found.periodogram_p == pytest.approx(expected.pvalue, rel=1e-9)  # n <= 140


@pytest.mark.parametrize("p_values", [[0.3], [0.01, 0.9, 0.2], [1.0, 1.0], [1e-300, 0.5]])
def test_combined_p_matches_fisher_of_scipy(p_values: list[float]) -> None:
    expected = stats.combine_pvalues(p_values).pvalue
    assert combined_p(p_values) == pytest.approx(expected, rel=1e-12)
