"""Whether a series is white: tests whose false alarm rate is what it says, also for short runs.

The cumulative periodogram of white Gaussian noise, taken at the Fourier frequencies without zero
and Nyquist, is distributed as ordered uniform numbers (Bartlett 1955; Box, Jenkins, Reinsel and
Ljung 2016, section 8.2.5), so that the distance from its diagonal is Kolmogorov's statistic. The
autocorrelations sum to chi-square (Ljung and Box 1978)."""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sysid.validation.results import Whiteness

Array = NDArray[np.float64]

MIN_SAMPLES = 40
"""Fewer tell nothing; four seconds."""
LAGS_S = 2.0


def whiteness(innovations: Array, dt: float) -> Whiteness | None:
    """Of normalised innovations sampled every ``dt`` seconds, (samples,); None for too few of
    them."""
    if innovations.size < MIN_SAMPLES:
        return None
    centred = innovations - np.mean(innovations)
    distance, p = _cumulative_periodogram(centred)
    return Whiteness(
        mean_square=float(np.mean(innovations**2)),
        distance=distance,
        periodogram_p=p,
        ljung_box_p=_ljung_box(centred, round(LAGS_S / dt)),
    )


def cumulative_periodogram(centred: Array) -> Array:
    """Share of the power at and below each Fourier frequency but the last, (ordinates - 1,); rises
    as the diagonal."""
    power = np.abs(np.fft.rfft(centred))[1 : (centred.size - 1) // 2 + 1] ** 2
    cumulated = np.cumsum(power)
    return np.asarray(cumulated[:-1] / cumulated[-1])


def _cumulative_periodogram(centred: Array) -> tuple[float, float]:
    found = stats.kstest(cumulative_periodogram(centred), "uniform")
    return float(found.statistic), float(found.pvalue)


def _ljung_box(centred: Array, lags: int) -> float:
    n = centred.size
    lags = min(lags, n // 4)
    power = float(centred @ centred)
    correlations = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)]) / power
    statistic = n * (n + 2.0) * float(np.sum(correlations**2 / (n - np.arange(1, lags + 1))))
    return float(stats.chi2.sf(statistic, lags))
