"""Outlier tests on the joint fit.

Runs to leave out, runs with warnings, errors of the model structure.

Every run is tested for anomalies against the fit of all runs (`score_test`). The run with the
smallest p value is left out if it is significant after Holm's correction, if its anomaly is large
enough to matter and if the structure of the model cannot be the cause. Then the others are tested
again, because an outlier distorts the fit that all are compared with.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from sysid.data.runs import Run
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.planes import PLANES, Plane
from sysid.screening import whitened_residuals
from sysid.screening.anomaly_models import GUST_S, Kind
from sysid.screening.repeatability import repeatability, repeated_runs
from sysid.screening.score_test import (
    Anomaly,
    Scores,
    evaluate,
    inflation,
    statistics_over_time,
)
from sysid.screening.whitened_residuals import Growth, Residuals, RunResiduals

FALSE_ALARM = 0.01
"""Share of clean runs that are flagged, over all kinds of anomaly and all times."""
FAMILY_ERROR_RATE = 0.01
"""Share of clean campaigns in which a run is left out (Holm 1979)."""
MAX_LIKELIHOOD_RATIO = 20.0
"""Likelihood ratio up to which another explanation is reported as an alternative."""
MIN_RUNS = 2
"""Minimum number of runs of a plane; no run is dropped below it."""
MAX_DROPPED_FRACTION = 1.0 / 3.0
"""Largest share of a plane's runs that may be dropped.

If more differ, the model or the vehicle changed.
"""
SIMILAR_SIZE = 0.75
"""Minimum size of a run, relative to another, at which an error that grows with size is visible."""
RESPONSE_PER_SIZE: dict[Kind, float] = {"gain error": 1.0, "speed off": 2.0}
"""Relative change of the response by the anomalies that act throughout a test in proportion to it.

The force of a surface goes with the square of the speed.
"""
MIN_STRUCTURE_SD = 3.0
"""Growth of the response with size is reported from this many standard deviations on."""


MIN_EFFECT: dict[Kind, float] = {
    "actuator slip": 0.04,
    "actuator offset": 0.04,
    "gain error": 0.03,
    "gust": 0.08,
    "speed off": 0.05,
}
"""Size of each kind of anomaly as a share of the test, below which it does not harm a fit.

The size of a test is that of its largest deflection; see `anomaly_models.sizes_of_test`. In a test
of 5 deg with Caribou they are 0.2 deg, 0.2 deg, 3 %, 0.2 deg/s^2 and 5 %.
"""


class RunScreening(NamedTuple):
    """Outlier tests of one run of the joint fit."""

    run: str
    scores: Scores
    """Score tests of the run's residual."""
    repeat: Scores | None
    """Score tests of the difference from runs of the same test; None if there are none."""
    reason: str
    """Reason to leave the run out; empty if it is accepted."""
    warnings: tuple[str, ...]
    """Findings in a run that is accepted."""


class ScreeningResult(NamedTuple):
    """Outlier tests of all runs of a fit."""

    screenings: tuple[RunScreening, ...]
    """One result for each run, in the order of the fit."""
    structure: tuple[str, ...]
    """Response errors that grow with the size of the test, in all runs of a plane."""


class _TestedRun(NamedTuple):
    """One run with its tests against the current fit."""

    residuals: RunResiduals
    scores: Scores
    repeat: Scores | None
    partners: tuple[str, ...]
    """Names of the other runs of the same test."""

    @property
    def tests(self) -> tuple[Scores, ...]:
        """Tests that count.

        The comparison with runs of the same test counts only with two or more partners; with one
        partner it is unknown which of the two is the outlier.
        """
        if self.repeat is None or len(self.partners) < 2:
            return (self.scores,)
        return self.scores, self.repeat

    @property
    def decisive(self) -> Scores:
        """Test with the smallest p value."""
        return min(self.tests, key=lambda test: test.p_value)


class _Others(NamedTuple):
    """Runs with which a run is compared."""

    tested: Sequence[_TestedRun]
    optimum: Residuals
    """Optimum against which they are tested."""


def find_outliers(fit: Fit, prior: Prior, all_runs: Sequence[Run] = ()) -> ScreeningResult:
    """Find the runs of a fit that contain an anomaly.

    Parameters
    ----------
    fit : Fit
        Joint fit of the runs.
    prior : Prior
        Prior of the fit.
    all_runs : sequence of Run
        Runs before any was left out; by default those of the fit. They limit how many may be
        dropped.

    Returns
    -------
    ScreeningResult
        Result for each run of the fit, and the errors of the model structure.
    """
    return find_outliers_among(whitened_residuals.linearise_runs(fit, prior), fit, prior, all_runs)


def find_outliers_among(
    linearised_runs: Sequence[RunResiduals], fit: Fit, prior: Prior, all_runs: Sequence[Run] = ()
) -> ScreeningResult:
    """Find the runs that contain an anomaly among runs that are linearised about a fit.

    Parameters
    ----------
    linearised_runs : sequence of RunResiduals
        Runs, see `whitened_residuals.linearise_runs`.
    fit : Fit
        Fit about which they are linearised.
    prior : Prior
        Prior of the fit.
    all_runs : sequence of Run
        As for `find_outliers`.

    Returns
    -------
    ScreeningResult
        Result for each run, and the errors of the model structure.
    """
    all_runs = all_runs or [run.dataset.run for run in linearised_runs]
    remaining = list(linearised_runs)
    outliers, ambiguous = dict[str, RunScreening](), dict[str, RunScreening]()
    while True:
        optimum = whitened_residuals.update_parameters(remaining, fit, prior)
        tested = _check_runs(remaining, optimum)
        worst = _select_outlier(tested, fit, prior, all_runs)
        if worst is None:
            break
        name, alternatives = _name(worst.residuals), _alternatives(worst, tested)
        outliers[name] = RunScreening(
            run=name,
            scores=worst.scores,
            repeat=worst.repeat,
            reason=_reason(worst, alternatives),
            warnings=(),
        )
        ambiguous |= {
            _name(alternative.residuals): _warn_alternative(alternative, name)
            for alternative in alternatives
        }
        remaining = [run for run in remaining if run is not worst.residuals]
    accepted = {
        _name(subject.residuals): _keep(
            subject, _Others([other for other in tested if other is not subject], optimum)
        )
        for subject in tested
    }
    screenings = {**accepted, **ambiguous, **outliers}
    return ScreeningResult(
        tuple(screenings[_name(run)] for run in linearised_runs), _structure(optimum, fit)
    )


def _check_runs(runs: Sequence[RunResiduals], optimum: Residuals) -> list[_TestedRun]:
    """Test every run against the optimum of all runs."""
    statistics = [
        statistics_over_time(
            run.signatures, optimum.residual_at_optimum(run), run.slopes, optimum.covariance
        )
        for run in runs
    ]
    tested = []
    for run, courses in zip(runs, statistics, strict=True):
        others = (
            other_courses
            for other, other_courses in zip(runs, statistics, strict=True)
            if other is not run and other.dataset.run.plane == run.dataset.run.plane
        )
        tested.append(
            _TestedRun(
                residuals=run,
                scores=evaluate(courses, inflation(others)),
                repeat=repeatability(run, optimum),
                partners=tuple(_name(partner) for partner in repeated_runs(run, optimum.runs)),
            )
        )
    return tested


def _select_outlier(
    tested: Sequence[_TestedRun], fit: Fit, prior: Prior, all_runs: Sequence[Run]
) -> _TestedRun | None:
    """Return the run to leave out next; None if there is none.

    Holm (1979): sorted by p value, candidate i of n is significant if its p value and those before
    it are at most FAMILY_ERROR_RATE / (n - i), i = 0, 1, ...
    """
    candidates = sorted(tested, key=_p_value)
    for rank, candidate in enumerate(candidates):
        if _p_value(candidate) > min(FALSE_ALARM, FAMILY_ERROR_RATE / (len(candidates) - rank)):
            return None
        others = _remaining(candidate, tested, fit, prior)
        if (
            _is_relevant(candidate.decisive.anomalies[0], candidate.residuals)
            and not _could_be_structure(candidate, others)
            and _can_be_dropped(candidate, tested, all_runs)
        ):
            return candidate
    return None


def _remaining(
    subject: _TestedRun, tested: Sequence[_TestedRun], fit: Fit, prior: Prior
) -> _Others:
    """Test the other runs against their own optimum, without the subject."""
    others = [other.residuals for other in tested if other is not subject]
    optimum = whitened_residuals.update_parameters(others, fit, prior)
    return _Others(_check_runs(others, optimum), optimum)


def _p_value(subject: _TestedRun) -> float:
    """Return the combined p value of the tests of a run (Bonferroni)."""
    return min(1.0, len(subject.tests) * subject.decisive.p_value)


def _is_relevant(anomaly: Anomaly, run: RunResiduals) -> bool:
    """Return whether an anomaly is large enough to affect the fit."""
    return abs(anomaly.size) >= MIN_EFFECT[anomaly.kind] * run.sizes_of_test[anomaly.kind]


def _could_be_structure(subject: _TestedRun, others: _Others) -> bool:
    """Return whether the model structure may be the cause.

    An error of the structure grows with the size of the test and appears in all large tests; an
    anomaly appears in one run.
    """
    return subject.decisive is subject.scores and (
        not any(other.scores.p_value > FALSE_ALARM for other in _similar_size(subject, others))
        or _is_within_growth(subject, others)
    )


def _is_within_growth(subject: _TestedRun, others: _Others) -> bool:
    """Return whether the others respond as differently to small and to large tests."""
    likeliest, plane = subject.scores.anomalies[0], subject.residuals.dataset.run.plane
    change = RESPONSE_PER_SIZE.get(likeliest.kind, math.inf) * abs(likeliest.size) / 100.0
    return change <= abs(_growth(others.optimum, plane).value)


def _similar_size(subject: _TestedRun, others: _Others) -> list[_TestedRun]:
    """Return the other runs of the plane that are about as large or larger."""
    plane = subject.residuals.dataset.run.plane
    min_size_rad = SIMILAR_SIZE * subject.residuals.size_rad
    return [
        other
        for other in others.tested
        if other.residuals.dataset.run.plane == plane and other.residuals.size_rad >= min_size_rad
    ]


def _can_be_dropped(
    subject: _TestedRun, tested: Sequence[_TestedRun], all_runs: Sequence[Run]
) -> bool:
    """Return whether enough runs of the plane remain without this one."""
    plane = subject.residuals.dataset.run.plane
    total = sum(run.plane == plane for run in all_runs)
    remaining = sum(other.residuals.dataset.run.plane == plane for other in tested) - 1
    return remaining >= max(MIN_RUNS, math.ceil((1.0 - MAX_DROPPED_FRACTION) * total))


def _alternatives(outlier: _TestedRun, tested: Sequence[_TestedRun]) -> list[_TestedRun]:
    """Return the runs of the plane that would explain the tests nearly as well if left out instead.

    If two similar runs differ, each looks anomalous against the other. Without further runs the
    choice between them is arbitrary.
    """
    plane = outlier.residuals.dataset.run.plane
    outlier_statistic = outlier.scores.anomalies[0].statistic ** 2
    return [
        candidate
        for candidate in tested
        if candidate is not outlier
        and candidate.residuals.dataset.run.plane == plane
        and candidate.scores.p_value <= FALSE_ALARM
        and outlier_statistic - candidate.scores.anomalies[0].statistic ** 2
        < 2.0 * math.log(MAX_LIKELIHOOD_RATIO)
    ]


def _warn_alternative(alternative: _TestedRun, left_out: str) -> RunScreening:
    """Return the result of an accepted run, with a warning that it may be the outlier."""
    anomaly = _explain(alternative.scores, alternative.residuals.dataset.run.plane)
    warning = (
        f"possible outlier: {anomaly}; or it is {left_out}, which was left out:"
        " the tests do not determine which"
    )
    return RunScreening(
        run=_name(alternative.residuals),
        scores=alternative.scores,
        repeat=alternative.repeat,
        reason="",
        warnings=(warning,),
    )


def _reason(outlier: _TestedRun, alternatives: Sequence[_TestedRun]) -> str:
    """Return the reason to leave a run out, with the runs that may be the outlier instead."""
    explanation = _explain(outlier.decisive, outlier.residuals.dataset.run.plane)
    if alternatives:
        names = " or ".join(_name(alternative.residuals) for alternative in alternatives)
        explanation += f"; or it is {names}: fly both again"
    if outlier.decisive is outlier.scores:
        return explanation
    return f"non-repeatability: unlike {', '.join(outlier.partners)}, as if by {explanation}"


def _keep(subject: _TestedRun, others: _Others) -> RunScreening:
    """Return the result of an accepted run, with its warnings."""
    plane, warnings = subject.residuals.dataset.run.plane, []
    if subject.scores.p_value <= FALSE_ALARM:
        cause = (
            "structure"
            if _similar_size(subject, others) and _could_be_structure(subject, others)
            else "possible outlier"
        )
        warnings.append(f"{cause}: {_explain(subject.scores, plane)}; {_why_kept(subject, others)}")
    if subject.repeat is not None and subject.repeat.p_value <= FALSE_ALARM:
        explanation = _explain(subject.repeat, plane)
        warnings.append(
            f"non-repeatability: unlike {', '.join(subject.partners)}, as if by {explanation}"
        )
    return RunScreening(
        run=_name(subject.residuals),
        scores=subject.scores,
        repeat=subject.repeat,
        reason="",
        warnings=tuple(warnings),
    )


def _why_kept(subject: _TestedRun, others: _Others) -> str:
    """Return why a run with an anomaly is accepted."""
    if not _is_relevant(subject.scores.anomalies[0], subject.residuals):
        return "too small to matter"
    if not _similar_size(subject, others):
        return "no other test is as large, so it may be the model's structure: fly it again"
    if _is_within_growth(subject, others):
        return "small and large tests differ by as much, so it may be the model's structure"
    if _could_be_structure(subject, others):
        return "every test as large shows something, so it is the model's structure"
    return f"{subject.scores.p_value:.2%} of clean runs show as much: too many to leave it out"


def _explain(run_scores: Scores, plane: Plane) -> str:
    """Describe the most likely anomaly, and the second if it explains the run nearly as well."""
    likeliest, *others = run_scores.anomalies
    alternatives = [
        anomaly
        for anomaly in others
        if likeliest.statistic**2 - anomaly.statistic**2 < 2.0 * math.log(MAX_LIKELIHOOD_RATIO)
    ]
    return " or ".join(describe(anomaly, plane) for anomaly in (likeliest, *alternatives[:1]))


def _percent(value: float) -> str:
    """Return a percentage with whole percent from 10 on, two significant digits below."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def describe(anomaly: Anomaly, plane: Plane) -> str:
    """Describe an anomaly with its size, one standard deviation and its time."""
    surface = PLANES[plane].surface
    size, sd = abs(anomaly.size), anomaly.sd
    offset_text = f"{size:.2f} +- {sd:.2f} deg"
    percent_text = f"{_percent(size)} +- {_percent(sd)} %"
    is_positive = anomaly.size > 0.0
    match anomaly.kind:
        case "actuator slip":
            description = (
                f"{surface} jumped by {math.copysign(1.0, anomaly.size) * size:+.2f} +-"
                f" {sd:.2f} deg"
            )
        case "actuator offset":
            side = "above" if is_positive else "below"
            description = f"{surface} {offset_text} {side} its position in the other runs"
        case "gain error":
            comparison = "more" if is_positive else "less"
            description = f"{surface} moved {percent_text} {comparison} than in the other runs"
        case "gust":
            description = f"a push of {anomaly.size:+.2f} +- {sd:.2f} deg/s2 for {GUST_S:g} s"
        case "speed off":
            comparison = "faster" if is_positive else "slower"
            description = f"{percent_text} {comparison} than the other runs at the same thrust"
    return f"{anomaly.kind}: {description}" + (
        f" at {anomaly.at_s:.1f} s" if anomaly.at_s is not None else ""
    )


def _structure(optimum: Residuals, fit: Fit) -> tuple[str, ...]:
    """Report significant growth of the response with the size of the test."""
    growths = {plane: _growth(optimum, plane) for plane in Plane if plane in fit.datasets}
    return tuple(
        f"structure: the response to the largest {plane} test differs from the model's by"
        f" {100 * growth.value:+.0f} +- {100 * growth.sd:.0f} %"
        for plane, growth in growths.items()
        if growth.value != 0.0
    )


def _growth(optimum: Residuals, plane: Plane) -> Growth:
    """Return the growth of the response of a plane, with value 0 if it is not significant."""
    growth = optimum.growth(plane)
    is_significant = abs(growth.value) > MIN_STRUCTURE_SD * growth.sd
    return growth if is_significant else growth._replace(value=0.0)


def _name(run: RunResiduals) -> str:
    """Name of a run."""
    return run.dataset.run.name
