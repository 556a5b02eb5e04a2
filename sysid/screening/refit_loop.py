"""Loop of fit and outlier tests: fit, leave out the outliers that the tests find, fit again.

A second fit is made only if a run was left out. `shifts` is the influence of the runs that were
left out on the design numbers.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec

from sysid.data.runs import Run
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.models.model_file import IdentifiedModel, ParameterEstimate, Shift
from sysid.screening.outlier_tests import RunScreening, find_outliers

MAX_REFITS = 2
"""Maximum number of fits after the first. Outliers of the last fit give a warning and stay in."""


class RefitResult(NamedTuple):
    """Result of the loop of fit and outlier tests."""

    fit: Fit
    """Last fit, of the accepted runs."""
    accepted_runs: tuple[Run, ...]
    """Runs in the last fit."""
    screenings: dict[str, RunScreening]
    """Outlier tests by run name, each from the last fit that included the run."""
    structure: tuple[str, ...]
    """Warnings about the structure of the model, from the last fit."""
    fit_of_all_runs: Fit | None
    """Fit of all runs; None if no run was left out."""


def refit_until_clean(
    runs: Sequence[Run], prior: Prior, fit_runs: Callable[[Sequence[Run]], Fit]
) -> RefitResult:
    """Fit ``runs`` without the outliers that the fit itself reveals.

    Parameters
    ----------
    runs : sequence of Run
        Runs that passed the screening rules.
    prior : Prior
        Prior of the fit.
    fit_runs : callable
        Function that fits a sequence of runs.

    Returns
    -------
    RefitResult
        Last fit, its runs, and the outlier tests of all runs.
    """
    accepted, screenings = tuple(runs), dict[str, RunScreening]()
    latest_fit = first_fit = fit_runs(accepted)
    for refit_count in range(MAX_REFITS + 1):
        result = find_outliers(latest_fit, prior, runs)
        screenings |= {screening.run: screening for screening in result.screenings}
        outliers = {screening.run for screening in result.screenings if screening.reason}
        if not outliers or refit_count == MAX_REFITS:
            break
        accepted = tuple(run for run in accepted if run.name not in outliers)
        latest_fit = fit_runs(accepted)
    accepted_screenings = {run.name: _warning_only(screenings[run.name]) for run in accepted}
    return RefitResult(
        fit=latest_fit,
        accepted_runs=accepted,
        screenings=screenings | accepted_screenings,
        structure=result.structure,
        fit_of_all_runs=first_fit if len(accepted) < len(runs) else None,
    )


def _warning_only(screening: RunScreening) -> RunScreening:
    """Turn the rejection of an accepted run by the last fit into a warning."""
    rejection = (screening.reason,) if screening.reason else ()
    return screening._replace(reason="", warnings=(*rejection, *screening.warnings))


def shifts(with_all: IdentifiedModel, without: IdentifiedModel) -> tuple[Shift, ...]:
    """Compare the design numbers of two models.

    Parameters
    ----------
    with_all : IdentifiedModel
        Model from all runs.
    without : IdentifiedModel
        Model without the runs that were left out.

    Returns
    -------
    tuple of Shift
        Change of each number, also in standard deviations of the estimate without these runs.
    """
    changes = []
    for plane, plane_model in without.planes.items():
        before = msgspec.structs.asdict(with_all.planes[plane])
        for number, after in msgspec.structs.asdict(plane_model).items():
            if isinstance(after, ParameterEstimate) and after.sd:
                first = before[number].value
                changes.append(
                    Shift(
                        plane=plane,
                        number=number,
                        with_all=first,
                        value=after.value,
                        sds=(first - after.value) / after.sd,
                    )
                )
    return tuple(changes)
