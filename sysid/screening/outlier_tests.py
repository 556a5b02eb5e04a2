"""From test statistics to decisions: which runs to leave out, which to look at, and what is the
model's own fault."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sysid.data.segments import Plane, Run
from sysid.estimation.map.fit import Fit, Prior
from sysid.screening import whitened_residuals
from sysid.screening.anomaly_models import GUST_S, Kind
from sysid.screening.repeatability import repeatability, repeated_runs
from sysid.screening.score_test import Anomaly, Scores, scores
from sysid.screening.whitened_residuals import Residuals, RunResiduals

FALSE_ALARM = 0.01
"""Share of clean runs that are flagged, over all kinds of anomaly and all times."""
FAMILY_ERROR_RATE = 0.01
"""Share of clean campaigns that lose a run (Holm 1979)."""
MAX_LIKELIHOOD_RATIO = 20.0
"""Likelihood ratio within which another kind of anomaly explains a run as well."""
MIN_RUNS = 2
"""Of a plane; nothing is dropped below that."""
MAX_DROPPED_FRACTION = 1.0 / 3.0
"""Of a plane's runs that may be dropped: when more differ, it is the model or the vehicle that
changed."""
SIMILAR_SIZE = 0.75
"""A run of this share of another's size would show what grows with size."""
MIN_STRUCTURE_SD = 3.0
"""Standard deviations from which on growth with size is told."""


MIN_EFFECT: dict[Kind, float] = {
    "actuator slip": 0.2,
    "actuator offset": 0.2,
    "gain error": 3.0,
    "gust": 0.2,
    "speed off": 5.0,
}
"""Sizes, each in its unit, below which an anomaly is told but harms no fit: the play of a tailcone,
for one."""


class RunScreening(NamedTuple):
    """What the joint fit says of one run that was in it."""

    run: str
    scores: Scores
    repeat: Scores | None
    """Of the difference from matched runs; None without any."""
    reason: str
    """Why it should be left out; empty where it should not."""
    warnings: tuple[str, ...]


class ScreeningResult(NamedTuple):
    verdicts: tuple[RunScreening, ...]
    structure: tuple[str, ...]
    """What the model itself explains badly, in all runs of a plane."""


class _TestedRun(NamedTuple):
    exhibit: RunResiduals
    scores: Scores
    repeat: Scores | None
    partners: tuple[str, ...]


def find_outliers(found: Fit, prior: Prior, flown: Sequence[Run] = ()) -> ScreeningResult:
    """Ask the joint fit for anomalies of single runs. The worst is set aside first: it colours what
    others show.

    ``flown`` are the runs of which those of the fit are left; without them, all are.
    """
    exhibits = whitened_residuals.linearise_runs(found, prior)
    flown = flown or [exhibit.experiment.run for exhibit in exhibits]
    kept, out, doubted = list(exhibits), dict[str, RunScreening](), dict[str, RunScreening]()
    while True:
        weighed = whitened_residuals.update_parameters(kept, found, prior)
        tested = [_check_run(exhibit, weighed) for exhibit in kept]
        worst = _select_outlier(tested, found, prior, flown)
        if worst is None:
            break
        name, rivals = _name(worst.exhibit), _alternatives(worst, tested)
        out[name] = RunScreening(name, worst.scores, worst.repeat, _reason(worst, rivals), ())
        doubted |= {_name(rival.exhibit): _warn_alternative(rival, name) for rival in rivals}
        kept = [exhibit for exhibit in kept if exhibit is not worst.exhibit]
    staying = {_name(t.exhibit): _keep(t, [o for o in tested if o is not t]) for t in tested}
    verdicts = {**staying, **doubted, **out}
    return ScreeningResult(tuple(verdicts[_name(e)] for e in exhibits), _structure(weighed, found))


def _check_run(exhibit: RunResiduals, weighed: Residuals) -> _TestedRun:
    found = scores(exhibit.signatures, weighed.left(exhibit), exhibit.slopes, weighed.covariance)
    matched = tuple(_name(e) for e in repeated_runs(exhibit, weighed.exhibits))
    return _TestedRun(exhibit, found, repeatability(exhibit, weighed), matched)


def _select_outlier(
    tested: Sequence[_TestedRun], found: Fit, prior: Prior, flown: Sequence[Run]
) -> _TestedRun | None:
    """The run to leave out next: the surest by Holm's procedure whose anomaly matters and is not
    the model's."""
    suspects = sorted(tested, key=_p_value)
    for rank, suspect in enumerate(suspects):
        if _p_value(suspect) > min(FALSE_ALARM, FAMILY_ERROR_RATE / (len(suspects) - rank)):
            return None
        others = _remaining(suspect, tested, found, prior)
        if (
            _is_relevant(_anomaly_of(suspect))
            and not _could_be_structure(suspect, others)
            and _can_be_dropped(suspect, tested, flown)
        ):
            return suspect
    return None


def _remaining(
    t: _TestedRun, tested: Sequence[_TestedRun], found: Fit, prior: Prior
) -> list[_TestedRun]:
    """What the others show once a run is set aside, which colours the fit that all are judged
    by."""
    others = [o.exhibit for o in tested if o is not t]
    weighed = whitened_residuals.update_parameters(others, found, prior)
    return [_check_run(exhibit, weighed) for exhibit in others]


def _p_value(t: _TestedRun) -> float:
    """Of both tests, where there are enough matched runs to say which of them is the odd one."""
    if t.repeat is None or len(t.partners) < 2:
        return t.scores.p_value
    return min(1.0, 2.0 * min(t.scores.p_value, t.repeat.p_value))


def _anomaly_of(t: _TestedRun) -> Anomaly:
    return t.scores.anomalies[0] if _by_scores(t) or t.repeat is None else t.repeat.anomalies[0]


def _by_scores(t: _TestedRun) -> bool:
    return t.repeat is None or len(t.partners) < 2 or t.scores.p_value <= t.repeat.p_value


def _is_relevant(anomaly: Anomaly) -> bool:
    return abs(anomaly.size) >= MIN_EFFECT[anomaly.kind]


def _could_be_structure(t: _TestedRun, others: Sequence[_TestedRun]) -> bool:
    """Whether structure could be at fault: no test as large is clean. It grows with size; an
    anomaly does not."""
    return _by_scores(t) and not any(
        other.scores.p_value > FALSE_ALARM for other in _similar_size(t, others)
    )


def _similar_size(t: _TestedRun, others: Sequence[_TestedRun]) -> list[_TestedRun]:
    plane, least = t.exhibit.experiment.run.plane, SIMILAR_SIZE * t.exhibit.size_rad
    return [
        o for o in others if o.exhibit.experiment.run.plane == plane and o.exhibit.size_rad >= least
    ]


def _can_be_dropped(t: _TestedRun, tested: Sequence[_TestedRun], flown: Sequence[Run]) -> bool:
    """Whether the plane can do without one more run."""
    plane = t.exhibit.experiment.run.plane
    there = sum(run.plane == plane for run in flown)
    left = sum(o.exhibit.experiment.run.plane == plane for o in tested) - 1
    return left >= max(MIN_RUNS, math.ceil((1.0 - MAX_DROPPED_FRACTION) * there))


def _alternatives(worst: _TestedRun, tested: Sequence[_TestedRun]) -> list[_TestedRun]:
    """Runs of the plane that would, set aside in its place, explain the tests nearly as well.

    One of two alike is odd, and each looks so beside the other: where little else tells of them,
    chance decides which."""
    plane, most = worst.exhibit.experiment.run.plane, worst.scores.anomalies[0].statistic ** 2
    return [
        t
        for t in tested
        if t is not worst
        and t.exhibit.experiment.run.plane == plane
        and t.scores.p_value <= FALSE_ALARM
        and most - t.scores.anomalies[0].statistic ** 2 < 2.0 * math.log(MAX_LIKELIHOOD_RATIO)
    ]


def _warn_alternative(rival: _TestedRun, left_out: str) -> RunScreening:
    what = _explain(rival.scores, rival.exhibit.experiment.run.plane)
    told = f"suspect: {what}; or it is {left_out}, which was left out: the tests do not tell which"
    return RunScreening(_name(rival.exhibit), rival.scores, rival.repeat, "", (told,))


def _reason(t: _TestedRun, rivals: Sequence[_TestedRun]) -> str:
    what = _explain(
        t.scores if _by_scores(t) or t.repeat is None else t.repeat, t.exhibit.experiment.run.plane
    )
    if rivals:
        what += (
            f"; or it is {' or '.join(_name(rival.exhibit) for rival in rivals)}: fly both again"
        )
    return (
        what
        if _by_scores(t)
        else f"non-repeatability: unlike {', '.join(t.partners)}, as if by {what}"
    )


def _keep(t: _TestedRun, others: Sequence[_TestedRun]) -> RunScreening:
    plane, warnings = t.exhibit.experiment.run.plane, []
    if t.scores.p_value <= FALSE_ALARM:
        cause = (
            "structure"
            if _similar_size(t, others) and _could_be_structure(t, others)
            else "suspect"
        )
        warnings.append(f"{cause}: {_explain(t.scores, plane)}; {_why_kept(t, others)}")
    if t.repeat is not None and t.repeat.p_value <= FALSE_ALARM:
        what = _explain(t.repeat, plane)
        warnings.append(f"non-repeatability: unlike {', '.join(t.partners)}, as if by {what}")
    return RunScreening(_name(t.exhibit), t.scores, t.repeat, "", tuple(warnings))


def _why_kept(t: _TestedRun, others: Sequence[_TestedRun]) -> str:
    if not _is_relevant(t.scores.anomalies[0]):
        return "too small to matter"
    if not _similar_size(t, others):
        return "no other test is as large, so it may be the model's structure: fly it again"
    if _could_be_structure(t, others):
        return "every test as large shows something, so it is the model's structure"
    return f"{t.scores.p_value:.2%} of clean runs show as much: too many to leave it out"


def _explain(found: Scores, plane: Plane) -> str:
    """The likeliest anomaly, and what would explain the run nearly as well."""
    first, *others = found.anomalies
    near = [
        a
        for a in others
        if first.statistic**2 - a.statistic**2 < 2.0 * math.log(MAX_LIKELIHOOD_RATIO)
    ]
    return " or ".join(describe(anomaly, plane) for anomaly in (first, *near[:1]))


def describe(anomaly: Anomaly, plane: Plane) -> str:
    """The anomaly in words, with its size, one standard deviation and its time."""
    surface = "rudder" if plane == "yaw" else "elevator"
    size, sd = abs(anomaly.size), anomaly.sd
    about = f"{size:.2f} +- {sd:.2f} deg"
    share = f"{size:.0f} +- {sd:.0f} %"
    more = anomaly.size > 0.0
    match anomaly.kind:
        case "actuator slip":
            what = (
                f"{surface} jumped by {math.copysign(1.0, anomaly.size) * size:+.2f} +-"
                f" {sd:.2f} deg"
            )
        case "actuator offset":
            what = f"{surface} {about} {'above' if more else 'below'} where the other runs have it"
        case "gain error":
            what = f"{surface} moved {share} {'more' if more else 'less'} than in the other runs"
        case "gust":
            what = f"a push of {anomaly.size:+.2f} +- {sd:.2f} deg/s2 for {GUST_S:g} s"
        case "speed off":
            what = f"{share} {'faster' if more else 'slower'} than thrust says of the other runs"
    return f"{anomaly.kind}: {what}" + (
        f" at {anomaly.at_s:.1f} s" if anomaly.at_s is not None else ""
    )


def _structure(weighed: Residuals, found: Fit) -> tuple[str, ...]:
    """Growth of the answer with the size of the test, where it is sure."""
    growth, sd = weighed.shift[-2:], np.sqrt(np.diag(weighed.covariance)[-2:])
    return tuple(
        f"structure: the largest {plane} test is answered by {100 * g:+.0f} +- {100 * s:.0f} % of"
        " what the model says"
        for plane, g, s in zip(("yaw", "pitch"), growth, sd, strict=True)
        if plane in found.experiments and abs(g) > MIN_STRUCTURE_SD * s
    )


def _name(exhibit: RunResiduals) -> str:
    return exhibit.experiment.run.name
