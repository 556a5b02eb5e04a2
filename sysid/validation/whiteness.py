"""Whiteness tests whose false alarm rates hold for short runs too.

Cumulative periodogram: for white Gaussian noise, its values at the Fourier frequencies without zero
and Nyquist are distributed as ordered uniform numbers (Bartlett 1955; Box, Jenkins, Reinsel and
Ljung 2016, section 8.2.5). Its largest distance from the diagonal is Kolmogorov's statistic.
Autocorrelations: with r_k at lag k of n samples (Ljung and Box 1978)::

    Q = n (n + 2) sum_{k=1..h} r_k^2 / (n - k)   ~   chi-square with h degrees of freedom
"""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sysid.validation.results import Whiteness

Array = NDArray[np.float64]

MIN_SAMPLES = 40
"""Minimum number of samples: four seconds."""
LAGS_S = 2.0
"""Largest lag of the autocorrelations, s."""


def whiteness(innovations: Array, dt: float) -> Whiteness | None:
    """Test the whiteness of normalised innovations.

    Parameters
    ----------
    innovations : ndarray, (samples,)
        Innovations divided by their standard deviations.
    dt : float
        Sample time, s.

    Returns
    -------
    Whiteness or None
        Mean square and p values; None if there are fewer than MIN_SAMPLES samples.
    """
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
    """Return the share of the power at and below each Fourier frequency, without the last.

    Parameters
    ----------
    centred : ndarray, (samples,)
        Series without its mean.

    Returns
    -------
    ndarray, (ordinates - 1,)
        Increases along the diagonal for white noise.
    """
    power = np.abs(np.fft.rfft(centred))[1 : (centred.size - 1) // 2 + 1] ** 2
    cumulated = np.cumsum(power)
    return np.asarray(cumulated[:-1] / cumulated[-1])


def _cumulative_periodogram(centred: Array) -> tuple[float, float]:
    """Largest distance from the diagonal and its p value (Kolmogorov)."""
    result = stats.kstest(cumulative_periodogram(centred), "uniform")
    return float(result.statistic), float(result.pvalue)


def _ljung_box(centred: Array, lags: int) -> float:
    """P value of the autocorrelations up to ``lags`` (Ljung and Box 1978)."""
    samples = centred.size
    lags = min(lags, samples // 4)
    power = float(centred @ centred)
    correlations = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)]) / power
    statistic = (
        samples
        * (samples + 2.0)
        * float(np.sum(correlations**2 / (samples - np.arange(1, lags + 1))))
    )
    return float(stats.chi2.sf(statistic, lags))
