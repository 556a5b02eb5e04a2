"""Whiteness tests whose false alarm rates hold for short runs too.

Cumulative periodogram: for white Gaussian noise, its values at the Fourier frequencies without zero
and Nyquist are distributed as ordered uniform numbers (Bartlett 1955; Box, Jenkins, Reinsel and
Ljung 2016, section 8.2.5). Its largest distance from the diagonal is Kolmogorov's statistic.
Autocorrelations: with r_k at lag k of n samples (Ljung and Box 1978)::

    Q = n (n + 2) sum_{k=1..h} r_k^2 / (n - k)   ~   chi-square with h degrees of freedom
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, smirnov

from sysid.validation.results import Whiteness

Array = NDArray[np.float64]

MIN_SAMPLES = 40
"""Minimum number of samples: four seconds."""
LAGS_S = 2.0
"""Largest lag of the autocorrelations, s."""
ONE_SIDED_FROM = 4.0
"""Value of n D^2 from which the p value is twice the one-sided one, to 4e-11 of its value."""


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
    """Return the largest distance from the diagonal and its p value (Kolmogorov)."""
    shares = cumulative_periodogram(centred)
    diagonal = np.arange(shares.size + 1) / shares.size
    distance = float(max(np.max(diagonal[1:] - shares), np.max(shares - diagonal[:-1])))
    return distance, kolmogorov_p(distance, shares.size)


def kolmogorov_p(distance: float, samples: int) -> float:
    """Return the probability of a larger distance between uniform samples and the diagonal.

    Parameters
    ----------
    distance : float
        Kolmogorov's statistic D, 0 to 1.
    samples : int
        Number n of samples.

    Returns
    -------
    float
        Exact p value.

    Notes
    -----
    Marsaglia, Tsang and Wang 2003, J. Statistical Software 8(18), with k = ceil(n D), h = k - n D
    and m = 2 k - 1::

        p = 1 - n! / n^n (H^n)[k, k],    H[i, j] = 1 / (i - j + 1)! for i - j + 1 >= 0

    but for the first column and the last row: H[i, 1] = (1 - h^i) / i!, H[m, j] the same mirrored,
    H[m, 1] = (1 - 2 h^m + max(0, 2 h - 1)^m) / m!. Beyond ``ONE_SIDED_FROM`` the two sides exclude
    each other.
    """
    if samples * distance**2 >= ONE_SIDED_FROM:
        return float(min(1.0, 2.0 * smirnov(samples, distance)))
    k = math.ceil(samples * distance)
    h, m = k - samples * distance, 2 * k - 1
    inverse_factorials = np.cumprod(np.concatenate([[1.0], 1.0 / np.arange(1.0, m + 1.0)]))
    lags = np.subtract.outer(np.arange(m), np.arange(m)) + 1
    H = np.where(lags >= 0, inverse_factorials[np.maximum(lags, 0)], 0.0)
    edge = inverse_factorials[1:] * (1.0 - h ** np.arange(1.0, m + 1.0))
    H[:, 0], H[-1, :] = edge, edge[::-1]
    H[-1, 0] = inverse_factorials[m] * (1.0 - 2.0 * h**m + max(0.0, 2.0 * h - 1.0) ** m)
    # n! / n^n (H^n) = n! (e / n)^n (H / e)^n, which neither overflows nor underflows.
    power = np.linalg.matrix_power(H / math.e, samples)[k - 1, k - 1]
    factor = math.exp(math.lgamma(samples + 1.0) + samples - samples * math.log(samples))
    return float(min(1.0, max(0.0, 1.0 - factor * power)))


def combined_p(p_values: Sequence[float]) -> float:
    """Return the p value of several independent tests together (Fisher 1925, sec. 21.1).

    Parameters
    ----------
    p_values : sequence of float
        P values of the tests, at least one.

    Returns
    -------
    float
        Probability that chi-square with 2 n degrees of freedom exceeds -2 sum log p.
    """
    with np.errstate(divide="ignore"):
        statistic = -2.0 * float(np.sum(np.log(p_values)))
    return float(chdtrc(2.0 * len(p_values), statistic))


def _ljung_box(centred: Array, lags: int) -> float:
    """Return the p value of the autocorrelations up to ``lags`` (Ljung and Box 1978)."""
    samples = centred.size
    lags = min(lags, samples // 4)
    power = float(centred @ centred)
    correlations = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)]) / power
    statistic = (
        samples
        * (samples + 2.0)
        * float(np.sum(correlations**2 / (samples - np.arange(1, lags + 1))))
    )
    return float(chdtrc(lags, statistic))
