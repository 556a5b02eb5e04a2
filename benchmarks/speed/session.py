"""One run of the benchmark: what its measurements share."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.speed.results import Measurement
from benchmarks.speed.rows import ROWS


class Session:
    """Options of a run and its temporary folder.

    Parameters
    ----------
    folder : Path
        Empty folder for logs and campaigns; deleted after the run.
    repetitions : int or None
        Number of repetitions of every figure; None for the default of each row.
    peer : Path or None
        Checkout of PythonVehicleSimulator, for another peer of the physics.
    """

    def __init__(
        self, folder: Path, repetitions: int | None = None, peer: Path | None = None
    ) -> None:
        self.folder = folder
        self.peer = peer
        self._repetitions = repetitions

    def repetitions(self, row: str) -> int:
        """Return the number of repetitions of a row."""
        return self._repetitions or ROWS[row].repetitions

    def report(self, text: str) -> None:
        """Print a line of progress."""
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


Measure = Callable[[Session], list[Measurement]]
"""Measure one or several rows."""
Measures = Mapping[tuple[str, ...], Measure]
"""Functions by the rows that they measure."""
