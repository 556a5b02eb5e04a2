"""Smoothing, recursive filters and spectra of sampled signals.

scipy.signal has these too; importing it takes as long as fitting a model, and sysid needs no more
than these few.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import entry_point

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MAD_TO_SD = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation, 1 / 0.6745."""
SPIKE_WINDOW = 5
"""Samples around each sample whose median a spike is compared with."""
SPIKE_SDS = 6.0
"""Standard deviations from the median beyond which a sample is a spike."""


class SmoothedSignal(NamedTuple):
    """Straight lines through the samples around each sample."""

    value: Array
    """Value of the line at the sample, in the unit of the signal."""
    slope: Array
    """Slope of the line, in that unit per sample."""


class SignalSpectra(NamedTuple):
    """One-sided power and cross spectral densities of two signals."""

    frequency_hz: Array
    x: Array
    """Power spectral density of the first signal, its unit squared per Hz."""
    y: Array
    """Power spectral density of the second signal."""
    cross: ComplexArray
    """Cross spectral density conj(X) Y."""


def moving_mean(values: Array, width: int) -> Array:
    """Return the mean of ``width`` samples around each sample.

    Parameters
    ----------
    values : ndarray, (samples,)
        Signal; it is mirrored at its ends.
    width : int
        Odd number of samples.

    Returns
    -------
    ndarray, (samples,)
        Means.
    """
    padded = np.pad(values, width // 2, mode="symmetric")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def without_spikes(values: Array) -> Array:
    """Replace single wrong samples by the median of the samples around them.

    Parameters
    ----------
    values : ndarray, (samples,)
        Signal; it is mirrored at its ends. With fewer than SPIKE_WINDOW samples it is returned
        unchanged.

    Returns
    -------
    ndarray, (samples,)
        Signal without spikes of one or two samples; the other samples are unchanged.

    Notes
    -----
    Hampel 1974: a sample is wrong if it differs from the median of SPIKE_WINDOW samples by more
    than SPIKE_SDS standard deviations of this difference, which are MAD_TO_SD times its median over
    the signal. A step of the signal is no spike.
    """
    if values.size < SPIKE_WINDOW:
        return values
    padded = np.pad(values, SPIKE_WINDOW // 2, mode="symmetric")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, SPIKE_WINDOW), axis=1)
    difference = np.abs(values - medians)
    return np.where(difference > SPIKE_SDS * MAD_TO_SD * np.median(difference), medians, values)


class StraightLine(NamedTuple):
    """Straight line of least squares."""

    values: Array
    """Values of the line at the samples."""
    slope: float
    """Unit of the signal per unit of the abscissa; zero for a single sample."""


def fit_line(abscissa: Array, values: Array) -> StraightLine:
    """Fit a straight line of least squares.

    Parameters
    ----------
    abscissa, values : ndarray, (samples,)
        Points.

    Returns
    -------
    StraightLine
        Line at the abscissae, and its slope sum (t - mean t) y / sum (t - mean t)^2.
    """
    centred = abscissa - np.mean(abscissa)
    spread = float(centred @ centred)
    slope = float(centred @ values) / spread if spread > 0.0 else 0.0
    return StraightLine(np.mean(values) + slope * centred, slope)


def smooth(values: Array, window: int) -> SmoothedSignal:
    """Fit a straight line to the ``window`` samples around each sample.

    Parameters
    ----------
    values : ndarray, (samples,)
        Signal of at least ``window`` samples.
    window : int
        Odd number of samples.

    Returns
    -------
    SmoothedSignal
        Value and slope at every sample.

    Notes
    -----
    Savitzky and Golay 1964, polynomials of first order: with k = -m..m about a sample, value =
    sum x_k / (2 m + 1), slope = sum k x_k / sum k^2. The first and last m samples lie on the line
    of the first and last window.
    """
    half = window // 2
    lags = np.arange(-half, half + 1, dtype=np.float64)
    means = np.convolve(values, np.full(window, 1.0 / window), mode="valid")
    slopes = np.convolve(values, -lags / max(1.0, float(lags @ lags)), mode="valid")
    value = np.concatenate(
        [means[0] + slopes[0] * lags[:half], means, means[-1] + slopes[-1] * lags[half + 1 :]]
    )
    return SmoothedSignal(value, np.pad(slopes, half, mode="edge"))


@entry_point
def filter_recursively(numerator: Array, denominator: Array, values: Array, state: Array) -> Array:
    """Return a signal filtered by numerator / denominator in powers of the unit delay.

    Parameters
    ----------
    numerator, denominator : ndarray, (n + 1,)
        Coefficients b and a; a[0] is 1.
    values : ndarray, (samples,)
        Signal x.
    state : ndarray, (n,)
        State s before the first sample; zeros for rest.

    Returns
    -------
    ndarray, (samples,)
        Filtered signal y.

    Notes
    -----
    Transposed direct form II (Oppenheim and Schafer 2010, sec. 6.3)::

        y = b_0 x + s_1,    s_i <- b_i x - a_i y + s_(i+1),    s_(n+1) = 0
    """
    order = state.size
    s = np.zeros(order + 1)
    s[:order] = state
    filtered = np.empty(values.size)
    for k in range(values.size):
        y = s[0] + numerator[0] * values[k]
        for i in range(order):
            s[i] = s[i + 1] + numerator[i + 1] * values[k] - denominator[i + 1] * y
        filtered[k] = y
    return filtered


def resonance(frequency_radps: float, bandwidth: float, step_s: float) -> tuple[Array, Array]:
    """Return numerator and denominator of a filter that passes a band about a frequency.

    Parameters
    ----------
    frequency_radps : float
        Centre frequency, where the gain is 1.
    bandwidth : float
        Width between the frequencies of half power, as a share of the centre frequency.
    step_s : float
        Sample interval, s.

    Returns
    -------
    numerator, denominator : ndarray, (3,)
        Coefficients for `filter_recursively`.

    Notes
    -----
    Orfanidis 1996, Introduction to Signal Processing, sec. 11.3, with w the centre in radians per
    sample and g = 1 / (1 + tan(bandwidth w / 2))::

        H(z) = (1 - g) (1 - z^-2) / (1 - 2 g cos(w) z^-1 + (2 g - 1) z^-2)
    """
    w = frequency_radps * step_s
    gain = 1.0 / (1.0 + math.tan(0.5 * bandwidth * w))
    numerator = (1.0 - gain) * np.array([1.0, 0.0, -1.0])
    return numerator, np.array([1.0, -2.0 * gain * math.cos(w), 2.0 * gain - 1.0])


def averaged_spectra(x: Array, y: Array, rate_hz: float, segment: int) -> SignalSpectra:
    """Estimate spectra of two signals from overlapping segments.

    Parameters
    ----------
    x, y : ndarray, (samples,)
        Signals.
    rate_hz : float
        Samples per second.
    segment : int
        Samples of a segment; consecutive segments overlap by half.

    Returns
    -------
    SignalSpectra
        Means over the segments, each without its straight line and with a Hann window.

    Notes
    -----
    Welch 1967, IEEE Trans. Audio and Electroacoustics 15.
    """
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(segment) / segment)
    X, Y = (np.fft.rfft(_without_lines(_segments(signal, segment)) * window) for signal in (x, y))
    scale = _one_sided(segment) / (rate_hz * float(window @ window))
    return SignalSpectra(
        frequency_hz=np.arange(0.0, segment // 2 + 1) * (rate_hz / segment),
        x=scale * np.mean(np.abs(X) ** 2, axis=0),
        y=scale * np.mean(np.abs(Y) ** 2, axis=0),
        cross=scale * np.mean(X.conj() * Y, axis=0),
    )


def record_spectra(x: Array, y: Array, rate_hz: float, padded: int) -> SignalSpectra:
    """Estimate spectra of two whole records without their means.

    Parameters
    ----------
    x, y : ndarray, (samples,)
        Signals.
    rate_hz : float
        Samples per second.
    padded : int
        Number of samples to which the records are filled with zeros; sets the frequencies.

    Returns
    -------
    SignalSpectra
        Spectra of the whole records, neither averaged nor windowed.
    """
    X, Y = (np.fft.rfft(signal - np.mean(signal), padded) for signal in (x, y))
    scale = _one_sided(padded) / (rate_hz * x.size)
    return SignalSpectra(
        frequency_hz=np.arange(0.0, padded // 2 + 1) * (rate_hz / padded),
        x=scale * np.abs(X) ** 2,
        y=scale * np.abs(Y) ** 2,
        cross=scale * (X.conj() * Y),
    )


def _segments(values: Array, segment: int) -> Array:
    """Return the whole segments of a signal, overlapping by half, (segments, samples)."""
    every = np.lib.stride_tricks.sliding_window_view(values, segment)
    return np.asarray(every[:: segment - segment // 2])


def _without_lines(rows: Array) -> Array:
    """Return rows without their straight lines of least squares."""
    time = np.arange(rows.shape[1]) - 0.5 * (rows.shape[1] - 1)
    slopes = rows @ time / max(1.0, float(time @ time))
    return np.asarray(rows - rows.mean(axis=1, keepdims=True) - slopes[:, np.newaxis] * time)


def _one_sided(samples: int) -> Array:
    """Return 2 for each frequency that has a negative twin, else 1."""
    factors = np.full(samples // 2 + 1, 2.0)
    factors[0] = 1.0
    if samples % 2 == 0:
        factors[-1] = 1.0
    return factors
