"""Fit, ask the fit for anomalies, leave out what it names, fit again: a second fit only where a run
was left out."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from sysid.data.segments import Run
from sysid.estimation.map.fit import Fit, Prior
from sysid.screening.outlier_tests import RunScreening, find_outliers

MAX_REFITS = 2
"""Fits beyond the first at most: what shows only then is told, and stays."""


class RefitResult(NamedTuple):
    found: Fit
    kept: tuple[Run, ...]
    verdicts: dict[str, RunScreening]
    """By the run's name, each from the last fit that it was in."""
    structure: tuple[str, ...]
    with_all: Fit | None
    """The fit of all runs, where some were left out of the last one."""


def refit_until_clean(
    runs: Sequence[Run], prior: Prior, fit_runs: Callable[[Sequence[Run]], Fit]
) -> RefitResult:
    """Fit ``runs`` without those that the fit itself finds out."""
    kept, verdicts = tuple(runs), dict[str, RunScreening]()
    found = with_all = fit_runs(kept)
    for turn in range(MAX_REFITS + 1):
        sifted = find_outliers(found, prior, runs)
        verdicts |= {verdict.run: verdict for verdict in sifted.verdicts}
        out = {verdict.run for verdict in sifted.verdicts if verdict.reason}
        if not out or turn == MAX_REFITS:
            break
        kept = tuple(run for run in kept if run.name not in out)
        found = fit_runs(kept)
    stayed = {run.name: _warning_only(verdicts[run.name]) for run in kept}
    return RefitResult(
        found,
        kept,
        verdicts | stayed,
        sifted.structure,
        with_all if len(kept) < len(runs) else None,
    )


def _warning_only(verdict: RunScreening) -> RunScreening:
    """Of a run that stayed: what would have left it out in another round is a warning."""
    late = (verdict.reason,) if verdict.reason else ()
    return verdict._replace(reason="", warnings=(*late, *verdict.warnings))
