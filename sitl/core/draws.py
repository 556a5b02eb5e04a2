"""Random numbers for the compiled tick: every stream is drawn in blocks, for many ticks at a time.

A block of numpy holds the numbers that single draws would give, so the length of a block has no
effect on a simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from mavlink_io.jit import numeric
from sitl.vehicle.vectors import Vector

SLOW, WAVE, IMU, MAGNETOMETER, PRESSURE, DRIFT, RUDDER, ELEVATOR = range(8)
"""Rows: disturbance moments, sensors, variation of the current, and lost motor steps.

Lost steps are uniform on [0, 1), all others normal with zero mean and unit variance.
"""
UNIFORM = (RUDDER, ELEVATOR)
AT_START = 64
"""Largest number of draws of one stream for the initial state."""
PER_TICK = 16
"""Largest number of draws of one stream in a tick with up to as many substeps."""
BLOCK = 200 * PER_TICK
"""Numbers of a stream that are drawn at a time."""


class DrawTable(NamedTuple):
    """Numbers for the next ticks."""

    values: Vector
    """One row for each stream, (streams, BLOCK)."""
    used: NDArray[np.int64]
    """Number of draws that each row has given, (streams,)."""


class Draws:
    """The streams of `DrawTable` with their generators.

    Parameters
    ----------
    generators : sequence of Generator
        Generator of each row.
    """

    def __init__(self, generators: Sequence[Generator]) -> None:
        self._draw: list[Callable[[int], Vector]] = [
            generator.random if row in UNIFORM else generator.standard_normal
            for row, generator in enumerate(generators)
        ]
        count = len(self._draw)
        self.table = DrawTable(np.empty((count, BLOCK)), np.full(count, BLOCK))
        self._left = 0
        """Numbers that each row still has, at least."""

    def prepare(self, count: int) -> None:
        """Provide ``count`` more numbers of each stream, at most `BLOCK`."""
        if self._left < count:
            self._fill()
            self._left = BLOCK
        self._left -= count

    def normals(self, stream: int, count: int) -> list[float]:
        """Return the next numbers of a stream, for the initial state.

        Parameters
        ----------
        stream : int
            Row of the stream.
        count : int
            Number of draws, for which ``prepare`` has been called.

        Returns
        -------
        list of float
            The numbers.
        """
        numbers: list[float] = take(self.table, stream, count).tolist()
        return numbers

    def _fill(self) -> None:
        """Replace the numbers that have been used."""
        values, used = self.table
        for row, draw in enumerate(self._draw):
            count = int(used[row])
            if count:
                values[row, : BLOCK - count] = values[row, count:].copy()
                values[row, BLOCK - count :] = draw(count)
                used[row] = 0


@numeric
def draw(table: DrawTable, stream: int) -> float:
    """Return the next number of a stream."""
    k = table.used[stream]
    table.used[stream] = k + 1
    return float(table.values[stream, k])


@numeric
def take(table: DrawTable, stream: int, count: int) -> Vector:
    """Return the next numbers of a stream."""
    k = table.used[stream]
    table.used[stream] = k + count
    return table.values[stream, k : k + count]
