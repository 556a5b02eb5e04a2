"""Monte-Carlo studies: run a trial with many seeds in parallel and compare figures with targets.

Each trial's numbers are kept in a file as they come (`sysid.trials`): a study that was ended, in
whatever way, continues where it was.
"""

import argparse
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from sysid.trials import map_trials, usable_cores

Array = NDArray[np.float64]
ALL_CASES = "all"
"""Name of all cases of a cell together."""
KEEP = Path("studies")
"""Default folder of the results of trials."""
Trial = Callable[[str, int], Sequence[float]]
"""(case, seed) -> numbers of one run, always the same count; NaN for a number that is undefined."""


class Figure(NamedTuple):
    """One result of a study."""

    name: str
    value: float
    lowest: float = -math.inf
    highest: float = math.inf
    """Limits of the target."""
    unit: str = ""

    @property
    def met(self) -> bool:
        """Whether the value is within the target."""
        return bool(self.lowest <= self.value <= self.highest)

    @property
    def target(self) -> str:
        """Text of the target; empty if there is none."""
        if math.isinf(self.lowest):
            return "" if math.isinf(self.highest) else f"<= {self.highest:g}"
        return (
            f">= {self.lowest:g}"
            if math.isinf(self.highest)
            else f"{self.lowest:g} to {self.highest:g}"
        )


class Cell(NamedTuple):
    """One experiment: a trial to repeat, and the evaluation of its numbers."""

    name: str
    about: str
    trial: Trial
    judge: Callable[[str, Array], Sequence[Figure]]
    """Return the figures of a case from an array of shape (runs, numbers per trial)."""
    runs: int = 200
    cases: tuple[str, ...] = ()
    """Cases of its own, which are also judged together; empty for those of the study."""
    campaigns: str = ""
    """Name of the campaigns that its trials evaluate, if another cell evaluates the same ones."""


class Outcome(NamedTuple):
    """Figures of a cell for one case."""

    cell: str
    case: str
    """Vehicle or sea."""
    runs: int
    figures: tuple[Figure, ...]


def parser(about: str | None, runs: str) -> argparse.ArgumentParser:
    """Return a parser with the options of every study; ``runs`` is the help text of --runs."""
    options = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--runs", type=int, help=runs)
    options.add_argument("--seed", type=int, default=1, help="seed of the first run")
    options.add_argument(
        "--jobs", type=_count, default=usable_cores(), help="processes; default one a core"
    )
    options.add_argument("--out", type=Path, help="JSON of all figures")
    options.add_argument(
        "--keep", type=Path, default=KEEP, help=f"folder of finished trials; default {KEEP}"
    )
    return options


def _count(text: str) -> int:
    """Return a number of processes. Raises ArgumentTypeError."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of 1 or more")
    return int(text)


def run_cells(
    questions: Iterable[tuple[Cell, str]], asked: argparse.Namespace, known: Sequence[Outcome] = ()
) -> list[Outcome]:
    """Run each cell for its case with the options of ``parser``; print and write the results.

    ``known`` holds results that exist already; they are printed and written first.
    """
    outcomes = list(known)
    for outcome in outcomes:
        show(outcome)

    def add(outcome: Outcome) -> None:
        """Print a result, and write all that there are."""
        outcomes.append(outcome)
        show(outcome)
        if asked.out:
            asked.out.write_text(as_json(outcomes, asked.seed), encoding="utf-8")

    pooled = dict[Cell, list[Array]]()
    for name, case, cells in with_same_campaigns(questions):
        seeds = {cell: range(asked.seed, asked.seed + (asked.runs or cell.runs)) for cell in cells}
        found = run_trials(seeds, case, asked.jobs, asked.keep / f"{name}.jsonl")
        for cell, rows in found.items():
            add(Outcome(cell.name, case, len(rows), tuple(cell.judge(case, rows))))
            if cell.cases:
                pooled.setdefault(cell, []).append(rows)
    for cell, groups in pooled.items():
        rows = np.concatenate(groups)
        add(Outcome(cell.name, ALL_CASES, len(rows), tuple(cell.judge(ALL_CASES, rows))))
    return outcomes


def with_same_campaigns(
    questions: Iterable[tuple[Cell, str]],
) -> list[tuple[str, str, list[Cell]]]:
    """Return the name of the campaigns, the case, and the cells that evaluate them."""
    groups = dict[tuple[str, str], list[Cell]]()
    for cell, case in questions:
        groups.setdefault((cell.campaigns or cell.name, case), []).append(cell)
    return [(name, case, cells) for (name, case), cells in groups.items()]


def exit_status(outcomes: Iterable[Outcome]) -> int:
    """Return the exit status of the process: 1 if a figure misses its target."""
    return 0 if all(figure.met for outcome in outcomes for figure in outcome.figures) else 1


def run_trials(
    seeds: Mapping[Cell, Sequence[int]], case: str, jobs: int = 1, keep: Path | None = None
) -> dict[Cell, Array]:
    """Return the numbers of each cell for one case, (seeds, numbers).

    ``seeds`` are those of each cell, ``keep`` is the file of finished trials. One process runs the
    trials of all cells with the same seed, one after the other: they can share a campaign.
    """
    cells_of = dict[int, list[Cell]]()
    for cell, own in seeds.items():
        for seed in own:
            cells_of.setdefault(seed, []).append(cell)
    with Progress(console=Console(stderr=True), transient=True) as bars:
        names = ", ".join(cell.name for cell in seeds)
        bar = bars.add_task(f"{names}, {case}", total=len(cells_of))
        found = map_trials(
            _numbers,
            [(case, seed, tuple(cell.trial for cell in cells)) for seed, cells in cells_of.items()],
            list[list[float]],
            jobs=jobs,
            keep=keep,
            on_result=lambda done: bars.update(bar, completed=done),
        )
    rows = dict[Cell, list[list[float]]]()
    for cells, numbers in zip(cells_of.values(), found, strict=True):
        for cell, row in zip(cells, numbers, strict=True):
            rows.setdefault(cell, []).append(row)
    return {cell: np.array(of_cell, dtype=np.float64) for cell, of_cell in rows.items()}


def _numbers(question: tuple[str, int, tuple[Trial, ...]]) -> list[list[float]]:
    """Return the numbers of each trial for a case and a seed."""
    case, seed, trials = question
    return [[float(number) for number in trial(case, seed)] for trial in trials]


def show(outcome: Outcome) -> None:
    """Print every figure with its target."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for figure in outcome.figures:
        mark = "" if not figure.target else "met" if figure.met else "MISSED"
        value = f"{figure.value:.4g} {figure.unit}".strip()
        table.add_row(
            outcome.cell,
            f"{outcome.case} x {outcome.runs}",
            figure.name,
            value,
            figure.target,
            mark,
        )
    Console(width=160).print(table)


def as_json(outcomes: Sequence[Outcome], seed: int) -> str:
    """Return all figures as JSON, one object per figure."""
    rows = [
        {
            "cell": o.cell,
            "case": o.case,
            "runs": o.runs,
            "seed": seed,
            "figure": f.name,
            "value": f.value,
            "unit": f.unit,
            "target": f.target,
            "met": f.met,
        }
        for o in outcomes
        for f in o.figures
    ]
    return json.dumps(rows, indent=1) + "\n"
