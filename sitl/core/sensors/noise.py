"""Chance, as the instruments draw it."""

from __future__ import annotations

from numpy.random import Generator

BLOCK = 600
"""Normal draws fetched at a time: asking numpy for three costs as much as reading three axes."""


class NoiseStream:
    """A random stream whose normal draws are fetched ahead."""

    def __init__(self, stream: Generator) -> None:
        self._stream = stream
        self._ready: list[float] = []
        self._next = 0

    def normals(self, count: int) -> list[float]:
        """So many draws of zero mean and unit variance."""
        start, end = self._next, self._next + count
        if end > len(self._ready):
            self._ready = self._ready[start:] + self._stream.standard_normal(BLOCK).tolist()
            start, end = 0, count
        self._next = end
        return self._ready[start:end]

    def normal(self) -> float:
        return self.normals(1)[0]

    def happens(self, chance: float) -> bool:
        """Whether something comes about that does so with ``chance``; what never does draws
        nothing."""
        return chance > 0.0 and bool(self._stream.random() < chance)

    def uniform(self, low: float, high: float) -> float:
        return float(self._stream.uniform(low, high))

    def pick(self, count: int) -> int:
        """One of the numbers below ``count``."""
        return int(self._stream.integers(count))
