"""Verdict of a dive as text: one headline, the next step, a table of the legs, the reasons."""

from collections.abc import Iterator
from typing import NamedTuple

from ground.client.assessment import (
    MAX_ERROR,
    UNIT,
    AssessedLeg,
    Assessment,
    ErrorCause,
    Outcome,
    format_heading,
    format_value,
)
from ground.client.dive_symptoms import SymptomKind
from sysid.monitor import tracking_metrics

_FINDING_RANK = {
    ErrorCause.SYMPTOM: -1,
    ErrorCause.SWINGING: 4,
    ErrorCause.UNSETTLED: 4,
    ErrorCause.UNKNOWN: 4,
    ErrorCause.LATE: 5,
}
"""Order of the findings: causes that are symptoms first; others have rank 2.

Those of rank 4 and 5 may be consequences of a fault that the vehicle has reported."""
_SYMPTOM_RANK = {
    SymptomKind.FAILSAFE: 1,
    SymptomKind.INJECTED: 1,
    SymptomKind.CUT_OFF: 1,
    SymptomKind.REPORTED: 3,
}
"""Order of the symptoms; others have rank 0."""


class Reason(NamedTuple):
    """One thing that a reader of the verdict must know."""

    cause: str
    """What was measured, and why."""
    remedy: str
    """Next step; empty if none is known."""

    @property
    def message(self) -> str:
        """Cause and remedy in one sentence."""
        return f"{self.cause}; {self.remedy}" if self.remedy else self.cause


def reasons(assessment: Assessment) -> list[Reason]:
    """Return everything odd about a dive, the gravest first.

    A symptom of the whole dive comes before the errors that it may cause, and an error that
    vanished in the second half of its leg comes last.

    Parameters
    ----------
    assessment : Assessment
        Result of `assess_log`.

    Returns
    -------
    list of Reason
        Empty for a dive without findings and symptoms.
    """
    ranked = [
        (_FINDING_RANK.get(f.cause, 2), Reason(f.message.removesuffix(f"; {f.remedy}"), f.remedy))
        for f in assessment.findings
    ]
    for symptom in assessment.symptoms:
        if not any(symptom.message in finding.message for finding in assessment.findings):
            rank = _SYMPTOM_RANK.get(symptom.kind, 0)
            ranked.append((rank, Reason(symptom.message, symptom.remedy)))
    if assessment.outcome is Outcome.UNKNOWN:
        # a leg that the end of the log cut short needs no longer mission
        is_cut_off = any(symptom.kind is SymptomKind.CUT_OFF for symptom in assessment.symptoms)
        ranked.append((5 if is_cut_off else -2, _why_not_assessed(assessment)))
    return [reason for _, reason in sorted(ranked, key=lambda pair: pair[0])]


def _why_not_assessed(assessment: Assessment) -> Reason:
    """Return why no leg can be assessed, and what would change that."""
    cause, has_advice, advice = assessment.reason.rpartition("; ")
    return Reason(cause, advice) if has_advice else Reason(advice, "look at the time plots")


def headline(assessment: Assessment) -> str:
    """Return what the dive showed, in one sentence without the outcome's word.

    Parameters
    ----------
    assessment : Assessment
        Result of `assess_log`.

    Returns
    -------
    str
        The errors if all are within the limits, else the cause of the gravest reason.
    """
    if ranked := reasons(assessment):
        return ranked[0].cause
    return _errors(assessment)


def next_step(assessment: Assessment) -> str:
    """Return what to do next, in one sentence.

    Parameters
    ----------
    assessment : Assessment
        Result of `assess_log`.

    Returns
    -------
    str
        The remedy of the gravest reason that has one.
    """
    if remedies := [reason.remedy for reason in reasons(assessment) if reason.remedy]:
        return remedies[0]
    if assessment.outcome is Outcome.GOOD:
        return "fly the next mission, or `ground campaign` for an identified model and its gains"
    return "look at the time plots"


def remark(leg: AssessedLeg) -> str:
    """Return the verdict of one leg.

    Parameters
    ----------
    leg : AssessedLeg
        Leg with its errors.

    Returns
    -------
    str
        ``good``, or the errors that exceed their limits.
    """
    errors = {"heading": leg.heading_deg, "depth": leg.depth_m}
    off = [
        f"{axis} {format_value(error.p95)} {UNIT[axis]} off"
        for axis, error in errors.items()
        if error.p95 > MAX_ERROR[axis]
    ]
    return ", ".join(off) or "good"


def format_text(assessment: Assessment) -> str:
    """Return the verdict: headline, next step, a table of the legs and the other reasons.

    Parameters
    ----------
    assessment : Assessment
        Result of `assess_log`.

    Returns
    -------
    str
        Lines.
    """
    lines = [f"{assessment.outcome}: {headline(assessment)}", f"next: {next_step(assessment)}"]
    if assessment.legs:
        lines += [
            f"errors from {tracking_metrics.SETTLING_S:g} s after each change of set-point, by the"
            " vehicle's own instruments; surfaces: mean and sd",
            f"  {'leg, s':>9s}  {'set-points':>14s}{'heading, deg':>14s}{'depth, m':>14s}"
            f"{'rudder, deg':>13s}{'elevator, deg':>15s}{'thrust':>8s}",
            f"  {'':25s}{'mean':>7s}{'95 %':>7s}{'mean':>7s}{'95 %':>7s}",
            *(_row(leg, assessment.start_s) for leg in assessment.legs),
        ]
    lines += list(_remarks(assessment))
    return "\n".join(lines)


def _errors(assessment: Assessment) -> str:
    """Return the largest 95 % errors of all legs."""
    heading = max(leg.heading_deg.p95 for leg in assessment.legs)
    depth = max(leg.depth_m.p95 for leg in assessment.legs)
    count = len(assessment.legs)
    legs = "the leg" if count == 1 else f"all {count} legs"
    return (
        f"heading within {format_value(heading)} deg and depth within {format_value(100 * depth)}"
        f" cm for 95 % of {legs}"
    )


def _remarks(assessment: Assessment) -> Iterator[str]:
    """Yield the reasons behind the first, short legs and learned trims."""
    yield from (reason.message for reason in reasons(assessment)[1:])
    if assessment.legs and assessment.symptoms and not assessment.findings:
        yield _errors(assessment)
    if assessment.reason and assessment.outcome is not Outcome.UNKNOWN:
        yield f"no leg can be assessed: {assessment.reason}"
    if assessment.short_legs and assessment.legs:
        legs = f"{assessment.short_legs} leg{'' if assessment.short_legs == 1 else 's'}"
        yield f"too short to assess: {legs}"
    if assessment.trims_learned:
        yield f"the vehicle learned its trims: {assessment.trims_learned}"


def _row(leg: AssessedLeg, start_s: float) -> str:
    """Return the row of a leg in the table."""
    span = f"{leg.start_s - start_s:.0f}-{leg.stop_s - start_s:.0f}"
    points = f"{format_heading(leg.heading_setpoint_deg)} deg, {leg.depth_setpoint_m:.1f} m"
    errors = "".join(f"{e.mean:7.2f}{e.p95:7.2f}" for e in (leg.heading_deg, leg.depth_m))
    rudder = f"{leg.rudder_deg:.1f} ± {leg.rudder_sd_deg:.1f}"
    elevator = f"{leg.elevator_deg:.1f} ± {leg.elevator_sd_deg:.1f}"
    stop = f", at a stop {leg.at_stop_pct:.0f} %" if leg.at_stop_pct >= 1.0 else ""
    return (
        f"  {span:>9s}  {points:>14s}{errors}{rudder:>13s}{elevator:>15s}{leg.thrust_pct:6.0f} %"
        f"  {remark(leg)}{stop}"
    )
