"""Random numbers of the slower sensors: normal numbers in blocks, others one by one.

A sensor may draw numbers of several kinds, and how many depends on what it measures, so each has a
generator of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from mavlink_io.jit import entry_point, kernel
from sitl.vehicle.vectors import Vector

BLOCK = 600
"""Normal numbers that are drawn at a time."""
MOST = 6
"""Largest number of normal draws of a sample."""


class NoiseStream(NamedTuple):
    """Random stream of a sensor; it advances."""

    generator: Generator
    ready: Vector
    """Normal numbers, shape (BLOCK + MOST,)."""
    limits: NDArray[np.int64]
    """Index of the next number in ``ready``, and of the end of the numbers."""


def noise_stream(generator: Generator) -> NoiseStream:
    """Return the stream of a generator."""
    return NoiseStream(generator, np.zeros(BLOCK + MOST), np.zeros(2, np.int64))


@kernel
def normals(stream: NoiseStream, count: int) -> Vector:
    """Return draws of zero mean and unit variance, at most `MOST`, valid until the next call."""
    start = stream.limits[0]
    if start + count > stream.limits[1]:
        _draw_block(stream.generator, stream.ready, stream.limits)
        start = 0
    stream.limits[0] = start + count
    return stream.ready[start : start + count]


@entry_point
def _draw_block(generator: Generator, ready: Vector, limits: NDArray[np.int64]) -> None:
    """Move the numbers that are left to the front, and draw a block behind them."""
    left = limits[1] - limits[0]
    for i in range(left):
        ready[i] = ready[limits[0] + i]
    ready[left : left + BLOCK] = generator.standard_normal(BLOCK)
    limits[0], limits[1] = 0, left + BLOCK


@kernel
def happens(stream: NoiseStream, chance: float) -> bool:
    """Return True with probability ``chance``; for zero nothing is drawn."""
    return chance > 0.0 and stream.generator.random() < chance


@kernel
def uniform(stream: NoiseStream, low: float, high: float) -> float:
    """Return a draw from the uniform distribution on [low, high)."""
    return float(stream.generator.uniform(low, high))


@kernel
def pick(stream: NoiseStream, count: int) -> int:
    """Return a random integer from 0 to ``count`` - 1."""
    return int(stream.generator.integers(0, count))
