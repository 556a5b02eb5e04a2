"""Fit, ask the fit for anomalies, leave out what it names, fit again: a second fit only where a run
was left out."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from sysid.data.segments import Run
from sysid.estimation.map.fit import Fit, Prior
from sysid.screening.outlier_tests import Verdict, sift

ROUNDS = 2
"""Fits beyond the first at most: what shows only then is told, and stays."""


class Settled(NamedTuple):
    found: Fit
    kept: tuple[Run, ...]
    verdicts: dict[str, Verdict]
    """By the run's name, each from the last fit that it was in."""
    structure: tuple[str, ...]
    with_all: Fit | None
    """The fit of all runs, where some were left out of the last one."""


def settle(runs: Sequence[Run], prior: Prior, fit_runs: Callable[[Sequence[Run]], Fit]) -> Settled:
    """Fit ``runs`` without those that the fit itself finds out."""
    kept, verdicts = tuple(runs), dict[str, Verdict]()
    found = with_all = fit_runs(kept)
    for turn in range(ROUNDS + 1):
        sifted = sift(found, prior, runs)
        verdicts |= {verdict.run: verdict for verdict in sifted.verdicts}
        out = {verdict.run for verdict in sifted.verdicts if verdict.reason}
        if not out or turn == ROUNDS:
            break
        kept = tuple(run for run in kept if run.name not in out)
        found = fit_runs(kept)
    stayed = {run.name: _told(verdicts[run.name]) for run in kept}
    return Settled(
        found,
        kept,
        verdicts | stayed,
        sifted.structure,
        with_all if len(kept) < len(runs) else None,
    )


def _told(verdict: Verdict) -> Verdict:
    """Of a run that stayed: what would have left it out in another round is a warning."""
    late = (verdict.reason,) if verdict.reason else ()
    return verdict._replace(reason="", warnings=(*late, *verdict.warnings))
