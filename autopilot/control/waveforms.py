"""Waveforms of test signals as functions of the time since the test began, within [-1, 1]. Pure.

Symbols: t time (s), T duration (s), f frequency (Hz). A caller multiplies by the amplitude.
"""

import cmath
import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

CHIRP_LEAD_CYCLES = 2.0
"""Cycles at the start frequency before the sweep: the initial transient decays in them."""

MAX_TONES = 64
"""Maximum number of tones of a multisine; in a wider band every second, third ... tone is used."""

THREE_TWO_ONE_ONE = (3, 2, 1, 1)
"""Switch intervals of a 3-2-1-1 signal; its mean is a seventh of its amplitude."""

_TAPS = {
    2: (2, 1),
    3: (3, 2),
    4: (4, 3),
    5: (5, 3),
    6: (6, 5),
    7: (7, 6),
    8: (8, 6, 5, 4),
    9: (9, 5),
    10: (10, 7),
    11: (11, 9),
    12: (12, 6, 4, 1),
    13: (13, 4, 3, 1),
}
"""Exponents of a primitive polynomial by order (P. Alfke, XAPP 052, 1996, table 3).

A shift register with feedback from these bits passes through all its states except zero.
"""
MAX_BITS = 2 ** max(_TAPS) - 1
"""Maximum number of bits of a pseudo-random binary sequence."""

_TOLERANCE = 1e-9
"""Tolerance in bits or intervals: a tick on an edge, apart from rounding, is after the edge."""


def chirp(t_s: float, start_hz: float, stop_hz: float, duration_s: float) -> tuple[float, float]:
    """Compute an exponential chirp.

    With f_0 the start frequency, t_0 the lead of CHIRP_LEAD_CYCLES cycles (at most T / 2), f_1 the
    stop frequency and g = ln(f_1 / f_0) / (T - t_0)::

        t < t_0:   f = f_0                       u = sin(2 pi f_0 t)
        else:      f = f_0 exp(g (t - t_0))      u = sin(2 pi (f_0 t_0 + (f - f_0) / g))

    Parameters
    ----------
    t_s : float
        t.
    start_hz, stop_hz : float
        f_0 and f_1.
    duration_s : float
        T.

    Returns
    -------
    tuple[float, float]
        u in [-1, 1], and f (Hz).
    """
    lead_s = min(CHIRP_LEAD_CYCLES / start_hz, 0.5 * duration_s)
    growth = math.log(stop_hz / start_hz) / (duration_s - lead_s)
    if t_s < lead_s or growth == 0.0:
        return math.sin(2.0 * math.pi * start_hz * t_s), start_hz
    frequency = start_hz * math.exp(growth * (t_s - lead_s))
    cycles = start_hz * lead_s + (frequency - start_hz) / growth
    return math.sin(2.0 * math.pi * cycles), frequency


def doublet(t_s: float, duration_s: float) -> float:
    """Compute a doublet: +1 for half of the duration, then -1; its mean is zero.

    Parameters
    ----------
    t_s : float
        Time since the start.
    duration_s : float
        Duration of the test.

    Returns
    -------
    float
        +1 or -1.
    """
    return 1.0 if t_s < 0.5 * duration_s else -1.0


def square(t_s: float, intervals: tuple[int, ...], duration_s: float) -> float:
    """Compute a square wave that starts at +1 and changes sign after each interval.

    Parameters
    ----------
    t_s : float
        Time since the start, in seconds.
    intervals : tuple of int
        Relative lengths of the intervals; (3, 2, 1, 1) is a 3-2-1-1.
    duration_s : float
        Sum of the intervals, in seconds.

    Returns
    -------
    float
        +1 or -1.
    """
    remaining, level = t_s / duration_s * sum(intervals) + _TOLERANCE, 1.0
    for length in intervals[:-1]:
        if remaining < length:
            return level
        remaining, level = remaining - length, -level
    return level


def prbs(t_s: float, clock_hz: float, duration_s: float, seed: int) -> float:
    """Compute a pseudo-random binary sequence (PRBS): +1 or -1 for each clock period.

    The order n is the least for which the period of 2^n - 1 bits is not shorter than the test. If
    ``clock_hz * duration_s`` is 2^n - 1 the test is one full period: the spectrum is flat except
    for the sinc of the hold, and the sum of all bits is one.

    Parameters
    ----------
    t_s : float
        Time since the start, in seconds.
    clock_hz : float
        Clock rate, in bits per second.
    duration_s : float
        Duration of the test, in seconds, which sets the order.
    seed : int
        Starting point in the sequence.

    Returns
    -------
    float
        +1 or -1.
    """
    bits = maximal_sequence(_order(clock_hz, duration_s), seed)
    return bits[min(len(bits) - 1, int(t_s * clock_hz + _TOLERANCE))]


def bits_of(clock_hz: float, duration_s: float) -> int:
    """Return the number of bits of a PRBS."""
    return math.ceil(clock_hz * duration_s - _TOLERANCE)


def _order(clock_hz: float, duration_s: float) -> int:
    """Return the order of the shift register."""
    return max(2, bits_of(clock_hz, duration_s).bit_length())


@lru_cache(maxsize=8)
def maximal_sequence(order: int, seed: int) -> tuple[float, ...]:
    """Return all 2^order - 1 bits of a maximum-length sequence as +1 and -1.

    Source: S. W. Golomb, Shift Register Sequences, 1967.
    """
    period = (1 << order) - 1
    register = 1 + seed % period
    return tuple(_shift_register(register, order, period))


def _shift_register(register: int, order: int, count: int) -> Iterator[float]:
    """Yield ``count`` output bits (+1 or -1) of a Fibonacci shift register."""
    shifts = [order - tap for tap in _TAPS[order]]
    for _ in range(count):
        yield 1.0 if register & 1 else -1.0
        feedback = sum(register >> shift for shift in shifts) & 1
        register = register >> 1 | feedback << (order - 1)


class Comb(NamedTuple):
    """Tones of a multisine: sines of equal amplitude at evenly spaced harmonics of 1 / T."""

    first: int
    """Harmonic of the lowest tone: its number of cycles in the duration."""
    spacing: int
    """Difference between the harmonics of two tones."""
    amplitudes: tuple[complex, ...]
    """Complex amplitudes of the tones, highest first, scaled so that the sum is in [-1, 1]."""


@lru_cache(maxsize=8)
def comb(start_hz: float, stop_hz: float, duration_s: float, part: int, parts: int) -> Comb:
    """Return one of ``parts`` combs without common tones, which are orthogonal over the duration.

    Tone k of N has the phase -pi k (k - 1) / N, which gives a low peak (M. R. Schroeder, Synthesis
    of low-peak-factor signals, IEEE Trans. Inf. Theory 16 (1970), eq. 11).

    Parameters
    ----------
    start_hz, stop_hz : float
        Lowest and highest frequency of the band, in Hz.
    duration_s : float
        Duration T of the test, in seconds; the tones are multiples of 1 / T.
    part : int
        Index of the comb, from 0.
    parts : int
        Number of combs.

    Returns
    -------
    Comb
        Tones with complex amplitudes, scaled so that the largest absolute value of the sum is 1.
    """
    lowest, highest = _harmonics(start_hz, stop_hz, duration_s)
    stride = max(1, math.ceil((highest - lowest + 1) / (MAX_TONES * parts)))
    tones = range(lowest + part * stride, highest + 1, parts * stride)
    count = len(tones)
    unscaled = [cmath.exp(-1j * math.pi * k * (k - 1) / count) for k in range(count, 0, -1)]
    scale = 1.0 / _peak(unscaled) if unscaled else 0.0
    return Comb(tones.start, tones.step, tuple(scale * amplitude for amplitude in unscaled))


def _harmonics(start_hz: float, stop_hz: float, duration_s: float) -> tuple[int, int]:
    """Return the lowest and the highest harmonic of 1 / T in the band."""
    return max(1, math.ceil(start_hz * duration_s - _TOLERANCE)), math.floor(
        stop_hz * duration_s + _TOLERANCE
    )


def multisine(t_s: float, tones: Comb, duration_s: float) -> float:
    """Compute a multisine: u = Im sum_k A_k exp(2 pi i n_k t / T), n_k = first + k spacing.

    The sum is evaluated by Horner's rule in the phasor of the spacing.

    Parameters
    ----------
    t_s : float
        Time t since the start.
    tones : Comb
        Tones with the complex amplitudes A_k.
    duration_s : float
        Duration T.

    Returns
    -------
    float
        u in [-1, 1].
    """
    phase_rate = 2j * math.pi * t_s / duration_s
    return (
        cmath.exp(phase_rate * tones.first)
        * _sum(tones.amplitudes, cmath.exp(phase_rate * tones.spacing))
    ).imag


def _sum(amplitudes: tuple[complex, ...] | list[complex], phasor: complex) -> complex:
    """Evaluate a polynomial in the phasor; the first amplitude has the highest power."""
    total = 0j
    for amplitude in amplitudes:
        total = total * phasor + amplitude
    return total


def _peak(amplitudes: list[complex]) -> float:
    """Return an upper bound of the modulus of the sum over all phases.

    The maximum of a trigonometric polynomial of degree d is at most 1 / cos(pi d / N) times its
    maximum on N equal steps (H. Ehlich and K. Zeller, Math. Z. 86, 1964). The squared modulus has
    the degree (number of tones) - 1.
    """
    steps = 16 * len(amplitudes)
    grid_max = max(abs(_sum(amplitudes, cmath.exp(2j * math.pi * k / steps))) for k in range(steps))
    return grid_max / math.sqrt(math.cos(math.pi * (len(amplitudes) - 1) / steps))


def fade(t_s: float, duration_s: float, fade_s: float) -> float:
    """Return the factor of a half-cosine fade at both ends of a test.

    Parameters
    ----------
    t_s : float
        Time since the start.
    duration_s : float
        Duration of the test.
    fade_s : float
        Length of the fade at each end; 0 for none.

    Returns
    -------
    float
        Factor in [0, 1].
    """
    to_edge_s = min(t_s, duration_s - t_s)
    if fade_s <= 0.0 or to_edge_s >= fade_s:
        return 1.0
    return 0.5 - 0.5 * math.cos(math.pi * max(0.0, to_edge_s) / fade_s)
