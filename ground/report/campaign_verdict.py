"""Verdict of a campaign: did the redesign work, by how much, and what to do next."""

from collections.abc import Iterator
from html import escape

from ground.campaign.summary import describe_performance, describe_unsettled
from ground.campaign.summary_file import CampaignSummary
from ground.client.assessment import Outcome, format_value
from ground.report.verdict_words import SIGNS, as_sentence

_ERRORS = {"heading_deg": ("heading", 1.0, "°"), "depth_m": ("depth", 100.0, " cm")}
"""Name, factor and unit of each error by which a redesign is judged."""


def card(summary: CampaignSummary) -> str:
    """Return the verdict as HTML.

    Parameters
    ----------
    summary : CampaignSummary
        Summary of a finished campaign.

    Returns
    -------
    str
        A section with outcome, sizes, and the next step.
    """
    problems, design = list(_problems(summary)), summary.design
    outcome = Outcome.ATTENTION if problems or design.kept_first else Outcome.GOOD
    good_title = "The first gains are kept" if design.kept_first else "The redesign worked"
    title = "Needs attention" if problems else good_title
    selected = [design.selection.reason] if design.selection and design.selection.reason else []
    performance = describe_performance(summary.monitoring, design.final_set)
    texts = (*selected, *problems, *performance)
    remarks = "".join(f"<p>{as_sentence(text)}</p>" for text in texts)
    return (
        f'<section class="verdict {outcome.name.lower()}">'
        f'<p class="outcome"><span class="sign">{SIGNS[outcome]}</span> {title}</p>'
        f"<p>{_changes(summary)}</p>{remarks}"
        f"<p><b>Next:</b> {as_sentence(_next_step(summary, problems))}</p></section>"
    )


def _problems(summary: CampaignSummary) -> Iterator[str]:
    """Yield each reason why the gains of the last dives should not be used as they are."""
    before, after = summary.steady_error["initial"], summary.steady_error["redesigned"]
    for key, (name, *_) in _ERRORS.items():
        if not summary.design.kept_first and getattr(after, key) > getattr(before, key):
            yield f"the {name} error has grown"
    yield from describe_unsettled(summary)
    assessment = summary.model.assessment
    if assessment is not None and not assessment.fit_for_redesign:
        yield "the model is not fit for redesign: " + "; ".join(assessment.reasons)
    if any(cause for report in summary.monitoring.values() for cause in report.causes):
        yield "the performance is not as predicted"


def _changes(summary: CampaignSummary) -> str:
    """Return the errors before and after the redesign in one sentence.

    Kept gains have one error: their two dives are repetitions.
    """
    before, after = summary.steady_error["initial"], summary.steady_error["redesigned"]
    parts = []
    for key, (name, factor, unit) in _ERRORS.items():
        was, now = getattr(before, key), getattr(after, key)
        if summary.design.kept_first:
            parts.append(f"{name} error {format_value(factor * now)}{unit}")
            continue
        change = f"{100.0 * abs(1.0 - now / was):.0f} % {'smaller' if now <= was else 'larger'}"
        errors = f"{format_value(factor * was)} → {format_value(factor * now)}{unit}"
        parts.append(f"{name} error {errors}" + (f" ({change})" if was > 0.0 else ""))
    text = " and ".join(parts)
    return escape(f"{text[:1].upper()}{text[1:]}, for 95 % of the straight run.")


def _next_step(summary: CampaignSummary, problems: list[str]) -> str:
    """Return what to do next."""
    if any(report.refit_recommended for report in summary.monitoring.values()):
        return "fly the tests again and refit the model; keep the initial gains until then"
    assessment = summary.model.assessment
    if problems and assessment is not None and assessment.obstacle:
        return f"no test can make the model fit: {assessment.obstacle}"
    if describe_unsettled(summary) and (assessment is None or assessment.fit_for_redesign):
        return "give the legs that do not settle more time, or smaller changes of depth and heading"
    if problems and assessment is not None and assessment.next_test is not None:
        return f"fly this test and refit: {assessment.next_test}"
    if problems:
        return "compare the dives below before you use the gains"
    if summary.design.kept_first:
        return (
            "fly on with the first gains, which `gains.param` holds with their predicted"
            " performance; a redesign can be better only within other limits"
            " (`ground redesign --spec`)"
        )
    return (
        "set the gains on the vehicle with `ground params load gains.param`, and fly with"
        " `ground fly MISSION --gains gains.param`, which compares each dive with the prediction"
    )
