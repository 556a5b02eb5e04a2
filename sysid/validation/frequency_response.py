"""The response from command to rate as the runs themselves show it, laid over the model's.

The model turns each run's commands into a rate, and the spectra tell by which factor, at each
frequency, the measured rate differs from it. That factor times the model's small-signal response is
the measured response. Short records and large motion shape measured and simulated rate alike and so
leave the factor alone, where a plain ratio of the spectra of rate and command would be bent by
them; and the coherence of the two is that of rate and command."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from sysid.data.segments import RATE_HZ
from sysid.estimation.map.fit import STRIDE
from sysid.validation.results import FrequencyComparison

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DT_S = STRIDE / RATE_HZ
POINTS = 20
"""Frequencies, evenly spaced by ratio: as many as the cost is defined on."""
BAND = 0.3, 3.0
"""Of the crossover: beyond it neither margin nor speed of a loop is decided."""
SMOOTHING_HALF_WIDTH, MIN_HALF_WIDTH_HZ = 0.15, 0.03
"""Half width over which spectra are averaged about a frequency, as a share of it and at least."""
MIN_COHERENCE = 0.6
"""Least coherence of a frequency that counts (Tischler and Remple 2006, section 7.5)."""
NARROWBAND_WAVES = ("step",)
"""Signals that hold still tell little of a response over frequency."""
_PADDED = 4096


class Pair(NamedTuple):
    """One run from shortly before its test: the rates that a model gives and that were measured, at
    ``RATE_HZ``."""

    run: str
    simulated_radps: Array
    measured_radps: Array


class Spectra(NamedTuple):
    """Summed over runs: of the simulated and the measured rate, and across, at each frequency."""

    frequency_radps: Array
    simulated: Array
    measured: Array
    across: ComplexArray
    averages: Array
    """How many independent estimates were averaged."""

    @property
    def coherence(self) -> Array:
        return np.asarray(np.abs(self.across) ** 2 / (self.simulated * self.measured))

    @property
    def factor(self) -> ComplexArray:
        """Measured over simulated rate."""
        return np.asarray(self.across / self.simulated)

    @property
    def random_error(self) -> Array:
        """Relative standard deviation of the factor's size, which in radians is that of its phase.

        Bendat and Piersol (2010), table 9.6.
        """
        squared = np.clip(self.coherence, 1e-6, 1.0)
        return np.asarray(np.sqrt((1.0 - squared) / (2.0 * self.averages * squared)))


def spectra(pairs: Sequence[Pair], frequency_radps: Array) -> Spectra:
    """Of simulated and measured rates, at least one pair."""
    total, seconds = np.zeros((3, _PADDED // 2 + 1), dtype=np.complex128), 0.0
    for pair in pairs:
        simulated, measured = _decimate(pair.simulated_radps), _decimate(pair.measured_radps)
        seconds += measured.size * DT_S
        for row, (x, y) in enumerate(
            ((simulated, simulated), (measured, measured), (simulated, measured))
        ):
            total[row] += measured.size * _cross(x, y)
    hz = np.fft.rfftfreq(_PADDED, DT_S)
    centre = frequency_radps / (2.0 * math.pi)
    reach = np.maximum(SMOOTHING_HALF_WIDTH * centre, MIN_HALF_WIDTH_HZ)
    means = np.array(
        [
            total[:, np.abs(hz - f) <= half].mean(axis=1)
            for f, half in zip(centre, reach, strict=True)
        ]
    ).T
    averages = np.maximum(1.0, 2.0 * reach * seconds)
    return Spectra(frequency_radps, means[0].real, means[1].real, means[2], averages)


def _cross(x: Array, y: Array) -> ComplexArray:
    """Whole records: they begin in straight flight, so that no window is needed that would hide
    half of them."""
    return np.asarray(
        signal.csd(
            x, y, fs=1.0 / DT_S, window="boxcar", nperseg=x.size, nfft=_PADDED, detrend="constant"
        )[1]
    )


def _decimate(values: Array) -> Array:
    """Means of STRIDE samples."""
    whole = values.size // STRIDE * STRIDE
    return np.asarray(values[:whole].reshape(-1, STRIDE).mean(axis=1))


def compare_responses(
    pairs: Sequence[Pair], response: ComplexArray, grid_radps: Array, crossover_radps: float
) -> FrequencyComparison:
    """Measured and modelled response about a crossover, from runs that sweep (at least one).

    Args:
        response: the model's small-signal response from command to rate on ``grid_radps``.
    """
    frequency = np.geomspace(BAND[0] * crossover_radps, BAND[1] * crossover_radps, POINTS)
    found = spectra(pairs, frequency)
    gain_db = np.interp(frequency, grid_radps, _db(response))
    phase_deg = np.degrees(np.interp(frequency, grid_radps, np.unwrap(np.angle(response))))
    return FrequencyComparison(
        runs=tuple(pair.run for pair in pairs),
        frequency_radps=_to_tuple(frequency),
        coherence=_to_tuple(found.coherence),
        gain_db=_to_tuple(gain_db + _db(found.factor)),
        phase_deg=_to_tuple(phase_deg + np.degrees(np.angle(found.factor))),
        gain_sd_db=_to_tuple(20.0 / math.log(10.0) * found.random_error),
        phase_sd_deg=_to_tuple(np.degrees(found.random_error)),
        model_gain_db=_to_tuple(gain_db),
        model_phase_deg=_to_tuple(phase_deg),
        mismatch_cost=mismatch_cost(found),
    )


def mismatch_cost(found: Spectra) -> float | None:
    """J of Tischler and Remple (2006), equations 11.4 and 11.5: mean squared error of gain in dB
    and of phase in degrees, the latter weighted by 0.01745, both by coherence; None where no
    frequency is coherent."""
    coherent = found.coherence >= MIN_COHERENCE
    if not np.any(coherent):
        return None
    factor = found.factor[coherent]
    weight = (1.58 * (1.0 - np.exp(-((found.coherence[coherent]) ** 2)))) ** 2
    errors = _db(factor) ** 2 + 0.01745 * np.degrees(np.angle(factor)) ** 2
    return float(20.0 * np.mean(weight * errors))


def _db(response: ComplexArray) -> Array:
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _to_tuple(values: Array) -> tuple[float, ...]:
    return tuple(values.tolist())
