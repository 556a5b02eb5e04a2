"""Random numbers of sensors that Python samples, drawn in blocks."""

from __future__ import annotations

from numpy.random import Generator

BLOCK = 600
"""Normal draws per call of numpy: a call for three draws takes as long as a sensor model."""


class NoiseStream:
    """A random stream that draws normal numbers in blocks."""

    def __init__(self, stream: Generator) -> None:
        self._stream = stream
        self._ready: list[float] = []
        self._next = 0

    def normals(self, count: int) -> list[float]:
        """Return ``count`` draws of zero mean and unit variance."""
        start, end = self._next, self._next + count
        if end > len(self._ready):
            self._ready = self._ready[start:] + self._stream.standard_normal(BLOCK).tolist()
            start, end = 0, count
        self._next = end
        return self._ready[start:end]

    def normal(self) -> float:
        """Return one draw of zero mean and unit variance."""
        return self.normals(1)[0]

    def happens(self, chance: float) -> bool:
        """Return True with probability ``chance``; for zero nothing is drawn."""
        return chance > 0.0 and bool(self._stream.random() < chance)

    def uniform(self, low: float, high: float) -> float:
        """Return a draw from the uniform distribution on [low, high)."""
        return float(self._stream.uniform(low, high))

    def pick(self, count: int) -> int:
        """Return a random integer from 0 to ``count`` - 1."""
        return int(self._stream.integers(count))
