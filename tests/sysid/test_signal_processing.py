"""Smoothing, filters and spectra. Reference: scipy.signal and scipy.ndimage, to rounding."""

import math
from functools import partial

import numpy as np
import pytest
from scipy import ndimage, signal

from sysid import signal_processing as processing

RATE_HZ = 50.0
NOISE = np.random.default_rng(1).standard_normal((2, 1507)).cumsum(axis=1)
assert_close = partial(np.testing.assert_allclose, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("width", [1, 5, 25])
def test_moving_mean_matches_scipy(width: int) -> None:
    expected = ndimage.uniform_filter1d(NOISE[0], width)
    assert_close(processing.moving_mean(NOISE[0], width), expected)


@pytest.mark.parametrize("window", [1, 3, 101, 1507])
def test_smooth_matches_savitzky_golay(window: int) -> None:
    smoothed = processing.smooth(NOISE[0], window)
    if window > 1:
        value = signal.savgol_filter(NOISE[0], window, 1)
        slope = signal.savgol_filter(NOISE[0], window, 1, deriv=1)
        assert_close(smoothed.slope, slope)
    else:
        value = NOISE[0]
    assert_close(smoothed.value, value)


@pytest.mark.parametrize("order", [1, 2])
def test_filter_recursively_matches_lfilter(order: int) -> None:
    numerator, denominator = signal.butter(order, 0.1)
    state = np.arange(1.0, order + 1.0)
    expected, _ = signal.lfilter(numerator, denominator, NOISE[0], zi=state)
    filtered = processing.filter_recursively(numerator, denominator, NOISE[0], state)
    assert_close(filtered, expected)


@pytest.mark.parametrize("radps", [0.3, 2.0])
def test_resonance_matches_iirpeak(radps: float) -> None:
    expected = signal.iirpeak(radps, 2.0, fs=2.0 * math.pi / 0.2)
    assert_close(processing.resonance(radps, 0.5, 0.2), expected)


@pytest.mark.parametrize("segment", [300, 301])
def test_averaged_spectra_match_welch(segment: int) -> None:
    x, y = NOISE
    options = {"fs": RATE_HZ, "nperseg": segment, "detrend": "linear"}
    found = processing.averaged_spectra(x, y, RATE_HZ, segment)
    expected = (*signal.welch(x, **options), signal.welch(y, **options)[1])
    for got, reference in zip(found[:3], expected, strict=True):
        assert_close(got, reference)
    assert_close(found.cross, signal.csd(x, y, **options)[1])


def test_record_spectra_match_padded_periodogram() -> None:
    x, y = NOISE
    options = {"fs": RATE_HZ, "window": "boxcar", "nperseg": x.size, "nfft": 4096}
    options["detrend"] = "constant"
    found = processing.record_spectra(x, y, RATE_HZ, 4096)
    assert_close(found.x, signal.csd(x, x, **options)[1].real)
    assert_close(found.y, signal.csd(y, y, **options)[1].real)
    assert_close(found.cross, signal.csd(x, y, **options)[1])


def test_without_spikes_replaces_spikes_alone() -> None:
    """Two wrong samples in succession, and one at each end; a step of the signal is kept."""
    noise = 0.01 * np.random.default_rng(1).standard_normal(300)
    clean = noise + np.where(np.arange(300) < 150, 1.0, 1.5)
    wrong = [0, 80, 81, 299]
    spoilt = clean.copy()
    spoilt[wrong] += [1.0, -1.0, -1.2, 0.5]
    mended = processing.without_spikes(spoilt)
    np.testing.assert_array_equal(np.delete(mended, wrong), np.delete(clean, wrong))
    assert_close(mended[wrong], clean[wrong], atol=0.05)
    assert processing.without_spikes(spoilt[:4]).tolist() == spoilt[:4].tolist()


@pytest.mark.parametrize("samples", [2, 101])
def test_fit_line_matches_polyfit(samples: int) -> None:
    time_s = np.linspace(-3.0, 7.0, samples)
    line = processing.fit_line(time_s, NOISE[0, :samples])
    slope, offset = np.polyfit(time_s, NOISE[0, :samples], 1)
    assert line.slope == pytest.approx(slope, rel=1e-9)
    assert_close(line.values, slope * time_s + offset)


def test_fit_line_single_sample_has_no_slope() -> None:
    line = processing.fit_line(np.array([3.0]), np.array([5.0]))
    assert (line.values.tolist(), line.slope) == ([5.0], 0.0)
