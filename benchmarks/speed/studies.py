"""Run time of both Monte-Carlo studies, computed from two trials of each kind."""

import time
from collections.abc import Iterable, Sequence

from benchmarks import study
from benchmarks.identification.cells import CELLS, cases_of
from benchmarks.redesign import campaign
from benchmarks.redesign.cells import QUESTIONS
from benchmarks.speed.results import Measurement
from benchmarks.speed.session import Session
from benchmarks.study import Cell
from sysid.trials import usable_cores

FIRST_SEED = 1


def study_s(trials: Iterable[tuple[float, float, int]], cores: int) -> float:
    """Return the wall time of a study on several cores that are always busy.

    Parameters
    ----------
    trials : iterable
        For each kind: processor time of the first and of the second trial of a process (s), and the
        number of trials. The first also computes what a process computes once.
    cores : int
        Number of processes.

    Returns
    -------
    float
        Wall time (s).
    """
    return sum(second * runs / cores + max(0.0, first - second) for first, second, runs in trials)


def measure_sysid(session: Session) -> list[Measurement]:
    """Measure `study-sysid`."""
    kinds = [(cell, case) for cell in CELLS.values() for case in cases_of(cell)]
    return [measure_kinds(session, "study-sysid", kinds, 0.0)]


def measure_control(session: Session) -> list[Measurement]:
    """Measure `study-control`."""
    began_s = time.process_time()
    flown = campaign.fly(FIRST_SEED)
    gains = campaign.gain_sets(flown.trims, campaign.redesigned(flown).gains)
    first_s = time.process_time() - began_s
    session.report(f"study-control: campaign {first_s:.1f} s")
    kinds = [
        (question.cell(lambda: gains), case)
        for question in QUESTIONS.values()
        for case in question.cases
    ]
    return [measure_kinds(session, "study-control", kinds, first_s)]


def measure_kinds(
    session: Session, row: str, kinds: Sequence[tuple[Cell, str]], first_s: float
) -> Measurement:
    """Run two trials of each kind; return the time of the study (min) after `first_s` in one."""
    trials, details = [], dict[str, float]()
    for _, case, cells in study.with_same_campaigns(kinds):
        seconds = [
            [_trial_cpu_s(cell, case, seed) for cell in cells]
            for seed in (FIRST_SEED, FIRST_SEED + 1)
        ]
        for cell, first_trial_s, next_s in zip(cells, *seconds, strict=True):
            trials.append((first_trial_s, next_s, cell.runs))
            name = f"{cell.name}: processor time, min"
            details[name] = details.get(name, 0.0) + next_s * cell.runs / 60.0
            session.report(
                f"{row}: {len(trials)} of {len(kinds)}: {cell.name}, {case}: {next_s:.2f} s a"
                f" trial, {cell.runs} trials"
            )
    minutes = (first_s + study_s(trials, usable_cores())) / 60.0
    runs = sum(cell.runs for cell, _ in kinds)
    note = f"computed from two trials of each of {len(kinds)} kinds; the study has {runs}"
    return Measurement(row, (minutes,), note=note, details=details)


def _trial_cpu_s(cell: Cell, case: str, seed: int) -> float:
    """Return the processor time of a trial."""
    began_s = time.process_time()
    cell.trial(case, seed)
    return time.process_time() - began_s
