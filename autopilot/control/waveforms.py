"""The shapes of test signals: each a function of the time since the test began, within [-1, 1].
Pure."""

import cmath
import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

CHIRP_LEAD_CYCLES = 2.0
"""Cycles at the first frequency before the sweep, so that the start-up transient is behind it."""

MAX_TONES = 64
"""Of a multisine; where its band holds more, every second, third ... is played."""

THREE_TWO_ONE_ONE = (3, 2, 1, 1)
"""Its mean is a seventh of its size."""

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
"""By order: exponents of a primitive polynomial (P. Alfke, XAPP 052, 1996, table 3), so that a
shift register that is fed back from there runs through all its states but zero."""
MAX_BITS = 2 ** max(_TAPS) - 1

_SLACK = 1e-9
"""Of a bit or a unit: a tick that falls on an edge, but for rounding, is past it."""


def chirp(t_s: float, start_hz: float, stop_hz: float, duration_s: float) -> tuple[float, float]:
    """A sine whose frequency grows exponentially after a lead of whole cycles: its value and its
    frequency."""
    lead_s = min(CHIRP_LEAD_CYCLES / start_hz, 0.5 * duration_s)
    growth = math.log(stop_hz / start_hz) / (duration_s - lead_s)
    if t_s < lead_s or growth == 0.0:
        return math.sin(2.0 * math.pi * start_hz * t_s), start_hz
    frequency = start_hz * math.exp(growth * (t_s - lead_s))
    cycles = start_hz * lead_s + (frequency - start_hz) / growth
    return math.sin(2.0 * math.pi * cycles), frequency


def doublet(t_s: float, duration_s: float) -> float:
    """Half the time up, half the time down; no mean."""
    return 1.0 if t_s < 0.5 * duration_s else -1.0


def square(t_s: float, runs: tuple[int, ...], duration_s: float) -> float:
    """Up and down by turns, each for so many parts of the whole: (3, 2, 1, 1) is a 3-2-1-1."""
    left, level = t_s / duration_s * sum(runs) + _SLACK, 1.0
    for length in runs[:-1]:
        if left < length:
            return level
        left, level = left - length, -level
    return level


def prbs(t_s: float, clock_hz: float, duration_s: float, seed: int) -> float:
    """A pseudo-random binary sequence: up or down, decided anew ``clock_hz`` times a second.

    It never comes to its period's end, or just does where ``clock_hz * duration_s`` is 2^n - 1: its
    spectrum is then flat but for what holding a bit takes off (sinc), and its mean is one bit's.
    Seeds start it at different places."""
    bits = maximal_sequence(_order(clock_hz, duration_s), seed)
    return bits[min(len(bits) - 1, int(t_s * clock_hz + _SLACK))]


def bits_of(clock_hz: float, duration_s: float) -> int:
    """How many bits a pseudo-random sequence plays."""
    return math.ceil(clock_hz * duration_s - _SLACK)


def _order(clock_hz: float, duration_s: float) -> int:
    return max(2, bits_of(clock_hz, duration_s).bit_length())


@lru_cache(maxsize=8)
def maximal_sequence(order: int, seed: int) -> tuple[float, ...]:
    """All 2^order - 1 bits of a maximum-length sequence as +1 and -1 (S. W. Golomb, Shift Register
    Sequences, 1967)."""
    period = (1 << order) - 1
    register = 1 + seed % period
    return tuple(_cyclic_shift(register, order, period))


def _cyclic_shift(register: int, order: int, count: int) -> Iterator[float]:
    shifts = [order - tap for tap in _TAPS[order]]
    for _ in range(count):
        yield 1.0 if register & 1 else -1.0
        fed_back = sum(register >> shift for shift in shifts) & 1
        register = register >> 1 | fed_back << (order - 1)


class Comb(NamedTuple):
    """The tones of a multisine: equal sines at evenly spaced whole numbers of cycles in its
    length."""

    first: int
    """Cycles of the lowest tone in the whole length."""
    spacing: int
    """Cycles between two tones."""
    amplitudes: tuple[complex, ...]
    """Of the tones, highest first: their phases, and the size with which their sum stays within
    [-1, 1]."""


@lru_cache(maxsize=8)
def comb(start_hz: float, stop_hz: float, duration_s: float, part: int, parts: int) -> Comb:
    """One of ``parts`` combs that have no tone in common, so that they are orthogonal over the
    whole length.

    Phases after M. R. Schroeder, Synthesis of low-peak-factor signals, IEEE Trans. Inf. Theory 16
    (1970), eq. 11, which spread the tones over the length as a sweep does."""
    lowest, highest = _harmonics(start_hz, stop_hz, duration_s)
    skip = max(1, math.ceil((highest - lowest + 1) / (MAX_TONES * parts)))
    tones = range(lowest + part * skip, highest + 1, parts * skip)
    count = len(tones)
    phased = [cmath.exp(-1j * math.pi * k * (k - 1) / count) for k in range(count, 0, -1)]
    scale = 1.0 / _peak(phased) if phased else 0.0
    return Comb(tones.start, tones.step, tuple(scale * amplitude for amplitude in phased))


def _harmonics(start_hz: float, stop_hz: float, duration_s: float) -> tuple[int, int]:
    """The lowest and the highest number of whole cycles in the length that the band holds."""
    return max(1, math.ceil(start_hz * duration_s - _SLACK)), math.floor(
        stop_hz * duration_s + _SLACK
    )


def multisine(t_s: float, tones: Comb, duration_s: float) -> float:
    """The sum of the tones, by Horner's rule in the spacing's own phasor."""
    turn = 2j * math.pi * t_s / duration_s
    return (
        cmath.exp(turn * tones.first) * _sum(tones.amplitudes, cmath.exp(turn * tones.spacing))
    ).imag


def _sum(amplitudes: tuple[complex, ...] | list[complex], phasor: complex) -> complex:
    total = 0j
    for amplitude in amplitudes:
        total = total * phasor + amplitude
    return total


def _peak(amplitudes: list[complex]) -> float:
    """No less than the sum ever comes to: the largest modulus on a grid, and what may lie between
    its points.

    A trigonometric polynomial of degree d is nowhere above its largest value on N equal steps by
    more than 1 / cos(pi d / N) (H. Ehlich and K. Zeller, Math. Z. 86, 1964); the modulus squared is
    one of degree count - 1."""
    steps = 16 * len(amplitudes)
    seen = max(abs(_sum(amplitudes, cmath.exp(2j * math.pi * k / steps))) for k in range(steps))
    return seen / math.sqrt(math.cos(math.pi * (len(amplitudes) - 1) / steps))


def fade(t_s: float, duration_s: float, fade_s: float) -> float:
    """Half-cosine rise and fall at the ends of a test."""
    edge = min(t_s, duration_s - t_s)
    if fade_s <= 0.0 or edge >= fade_s:
        return 1.0
    return 0.5 - 0.5 * math.cos(math.pi * max(0.0, edge) / fade_s)
