"""Measured frequency response from command to rate, compared with the model's.

The model turns each run's commands into a simulated rate. Symbols: S_ss, S_mm power spectra of
simulated and measured rate, S_sm their cross spectrum, summed over runs and averaged over
frequency; G the model's small-signal response::

    factor = S_sm / S_ss,    measured response = factor G,    coherence = |S_sm|^2 / (S_ss S_mm)

Short records and large motion change measured and simulated rate in the same way, so that they do
not affect the factor; they would distort a plain ratio of the spectra of rate and command. The
coherence of the two rates is that of rate and command.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map.datasets import STEP_S, STRIDE
from sysid.signal_processing import record_spectra
from sysid.validation.results import FrequencyComparison

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

POINTS = 20
"""Number of frequencies, in a geometric series; the mismatch cost is defined for 20."""
BAND = 0.3, 3.0
"""Band of the comparison, relative to the crossover.

Margins and speed do not depend on the rest.
"""
SMOOTHING_HALF_WIDTH, MIN_HALF_WIDTH_HZ = 0.15, 0.03
"""Half width of the average over frequency, relative to the frequency, and its minimum in Hz."""
MIN_COHERENCE = 0.6
"""Smallest coherence of a frequency that counts (Tischler and Remple 2006, section 7.5)."""
NARROWBAND_WAVES = ("step",)
"""Signals with constant parts, which excite few frequencies; all others count as sweeps."""
_PADDED = 4096
"""Length of the Fourier transform, samples."""


class Pair(NamedTuple):
    """Simulated and measured rate of a run from shortly before its test, rad/s, at ``RATE_HZ``."""

    run: str
    simulated_radps: Array
    measured_radps: Array


class Spectra(NamedTuple):
    """Spectra of simulated and measured rate, summed over runs, at each frequency."""

    frequency_radps: Array
    simulated: Array
    """Power spectrum of the simulated rate."""
    measured: Array
    """Power spectrum of the measured rate."""
    cross: ComplexArray
    """Cross spectrum of simulated and measured rate."""
    averages: Array
    """Number of independent estimates in the average."""

    @property
    def coherence(self) -> Array:
        """Magnitude squared coherence, 0 to 1."""
        return np.asarray(np.abs(self.cross) ** 2 / (self.simulated * self.measured))

    @property
    def factor(self) -> ComplexArray:
        """Measured over simulated rate."""
        return np.asarray(self.cross / self.simulated)

    @property
    def random_error(self) -> Array:
        """Relative standard deviation of the factor's magnitude; in radians also that of its phase.

        sqrt((1 - c) / (2 n c)) with coherence c and n averages (Bendat and Piersol 2010, table
        9.6).
        """
        squared = np.clip(self.coherence, 1e-6, 1.0)
        return np.asarray(np.sqrt((1.0 - squared) / (2.0 * self.averages * squared)))


def spectra(pairs: Sequence[Pair], frequency_radps: Array) -> Spectra:
    """Estimate the spectra of simulated and measured rates.

    Parameters
    ----------
    pairs : sequence of Pair
        At least one run.
    frequency_radps : ndarray
        Frequencies, rad/s.

    Returns
    -------
    Spectra
        Spectra at these frequencies.
    """
    # The records begin in straight flight and need no window; it would suppress half of them.
    total, seconds = np.zeros((3, _PADDED // 2 + 1), dtype=np.complex128), 0.0
    for pair in pairs:
        simulated, measured = _decimate(pair.simulated_radps), _decimate(pair.measured_radps)
        seconds += measured.size * STEP_S
        spectra_of_record = record_spectra(simulated, measured, 1.0 / STEP_S, _PADDED)
        total += measured.size * np.array(
            [spectra_of_record.x, spectra_of_record.y, spectra_of_record.cross]
        )
    grid_hz = np.fft.rfftfreq(_PADDED, STEP_S)
    centre_hz = frequency_radps / (2.0 * math.pi)
    half_width_hz = np.maximum(SMOOTHING_HALF_WIDTH * centre_hz, MIN_HALF_WIDTH_HZ)
    averaged = np.array(
        [
            total[:, np.abs(grid_hz - frequency_hz) <= width_hz].mean(axis=1)
            for frequency_hz, width_hz in zip(centre_hz, half_width_hz, strict=True)
        ]
    ).T
    averages = np.maximum(1.0, 2.0 * half_width_hz * seconds)
    return Spectra(
        frequency_radps=frequency_radps,
        simulated=averaged[0].real,
        measured=averaged[1].real,
        cross=averaged[2],
        averages=averages,
    )


def _decimate(values: Array) -> Array:
    """Return the means of STRIDE samples."""
    whole = values.size // STRIDE * STRIDE
    return np.asarray(values[:whole].reshape(-1, STRIDE).mean(axis=1))


def compare_responses(
    pairs: Sequence[Pair], response: ComplexArray, grid_radps: Array, crossover_radps: float
) -> FrequencyComparison:
    """Compare measured and modelled response about a crossover.

    Parameters
    ----------
    pairs : sequence of Pair
        Runs whose signals sweep over frequency, at least one.
    response : ndarray, complex
        Small-signal response of the model from command to rate on ``grid_radps``.
    grid_radps : ndarray
        Frequencies of ``response``, rad/s.
    crossover_radps : float
        Crossover frequency, rad/s.

    Returns
    -------
    FrequencyComparison
        Measured and modelled gain (dB) and phase (deg), coherence and mismatch cost.
    """
    frequency_radps = np.geomspace(BAND[0] * crossover_radps, BAND[1] * crossover_radps, POINTS)
    estimated = spectra(pairs, frequency_radps)
    gain_db = np.interp(frequency_radps, grid_radps, _db(response))
    phase_deg = np.degrees(np.interp(frequency_radps, grid_radps, np.unwrap(np.angle(response))))
    return FrequencyComparison(
        runs=tuple(pair.run for pair in pairs),
        frequency_radps=_to_tuple(frequency_radps),
        coherence=_to_tuple(estimated.coherence),
        gain_db=_to_tuple(gain_db + _db(estimated.factor)),
        phase_deg=_to_tuple(phase_deg + np.degrees(np.angle(estimated.factor))),
        gain_sd_db=_to_tuple(20.0 / math.log(10.0) * estimated.random_error),
        phase_sd_deg=_to_tuple(np.degrees(estimated.random_error)),
        model_gain_db=_to_tuple(gain_db),
        model_phase_deg=_to_tuple(phase_deg),
        mismatch_cost=mismatch_cost(estimated),
    )


def mismatch_cost(estimated: Spectra) -> float | None:
    """Return the mismatch cost J of Tischler and Remple (2006), equations 11.4 and 11.5.

    Parameters
    ----------
    estimated : Spectra
        Spectra with the factor and the magnitude-squared coherence c.

    Returns
    -------
    float or None
        None if no frequency is coherent.

    Notes
    -----
    With gain error g (dB), phase error p (deg), the mean taken over the coherent frequencies::

        J = 20 mean(W (g^2 + 0.01745 p^2)),    W = (1.58 (1 - exp(-c)))^2

    """
    is_coherent = estimated.coherence >= MIN_COHERENCE
    if not np.any(is_coherent):
        return None
    factor = estimated.factor[is_coherent]
    weight = (1.58 * (1.0 - np.exp(-estimated.coherence[is_coherent]))) ** 2
    errors = _db(factor) ** 2 + 0.01745 * np.degrees(np.angle(factor)) ** 2
    return float(20.0 * np.mean(weight * errors))


def _db(response: ComplexArray) -> Array:
    """Return the magnitude in dB."""
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _to_tuple(values: Array) -> tuple[float, ...]:
    """Convert an array to a tuple of floats."""
    return tuple(values.tolist())
