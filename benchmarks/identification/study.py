"""Runs cells: the same trial under many seeds, side by side on all cores, and each figure beside its target."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

Array = NDArray[np.float64]
Trial = Callable[[str, int], Sequence[float]]
"""(vehicle, seed) -> what one campaign gave, as many numbers every time; NaN where it gave none."""


class Figure(NamedTuple):
    """One number of the study."""

    name: str
    value: float
    lowest: float = -math.inf
    highest: float = math.inf
    """The target: within these."""
    unit: str = ""

    @property
    def met(self) -> bool:
        return self.lowest <= self.value <= self.highest


class Cell(NamedTuple):
    """One question to the identification."""

    name: str
    about: str
    trial: Trial
    judge: Callable[[str, Array], Sequence[Figure]]
    """Figures of a vehicle from (runs, numbers of a trial)."""
    runs: int = 200


class Outcome(NamedTuple):
    cell: str
    vehicle: str
    runs: int
    figures: tuple[Figure, ...]


def run(cell: Cell, vehicle: str, runs: int, first_seed: int, jobs: int) -> Outcome:
    """One cell for one vehicle. Seeds are ``first_seed`` and the ones after it."""
    seeds = range(first_seed, first_seed + runs)
    with ProcessPoolExecutor(jobs, mp_context=get_context("forkserver")) as pool:
        trials = pool.map(cell.trial, [vehicle] * runs, seeds, chunksize=max(1, runs // (8 * jobs)))
        what = f"{cell.name}, {vehicle}"
        rows = list(track(trials, what, total=runs, console=Console(stderr=True), transient=True))
    return Outcome(cell.name, vehicle, runs, tuple(cell.judge(vehicle, np.array(rows, dtype=np.float64))))
