"""Verdict of a campaign: it states what was done with the gains and what was measured."""

import re
from html import unescape
from pathlib import Path

from msgspec.structs import replace

from ground.campaign import summary
from ground.campaign.summary_file import CampaignSummary, SteadyErrorEntry
from ground.report import campaign_verdict
from sysid.monitor import MonitorReport
from sysid.monitor.sequential import RmsComparison
from sysid.monitor.tracking_metrics import TrackingMetrics
from sysid.monte_carlo.gain_selection import GainSelection
from tests.ground.campaign.test_summary_file import SPREAD, SUMMARY

KEPT = GainSelection(
    kept_first=True,
    heading_ratio=1.0,
    depth_ratio=1.0,
    reason="the first gains are kept; redesigned ones hold depth (2.11 times) worse",
)
RELAXED = GainSelection(
    kept_first=False,
    heading_ratio=0.6,
    depth_ratio=0.2,
    reason="limits GM 7 dB, PM 45 deg: no gains within stricter ones hold heading",
)
BEFORE = SteadyErrorEntry(heading_deg=1.2, pitch_deg=0.8, depth_m=0.3)
AFTER = SteadyErrorEntry(heading_deg=0.6, pitch_deg=0.7, depth_m=0.05)


def monitored(**ratios: float) -> MonitorReport:
    """Return a report without alarm whose rms errors are these multiples of the predicted ones."""
    rms = {name: RmsComparison(measured=ratio, predicted=1.0) for name, ratio in ratios.items()}
    return replace(SUMMARY.monitoring["straight_run"], rms=rms, causes=())


def campaign(
    selection: GainSelection | None = None,
    initial: SteadyErrorEntry = BEFORE,
    redesigned: SteadyErrorEntry = AFTER,
) -> CampaignSummary:
    """Return the summary of a campaign that performs as predicted."""
    return replace(
        SUMMARY,
        design=replace(SUMMARY.design, selection=selection),
        monitoring={"straight_run": monitored(heading_deg=1.0)},
        steady_error={"initial": initial, "redesigned": redesigned},
    )


def card(found: CampaignSummary) -> str:
    """Return the text of the verdict without its markup."""
    return unescape(re.sub("<[^>]+>", " ", campaign_verdict.card(found)))


def test_verdict_redesigned_gains_better_than_first_worked() -> None:
    text = card(campaign())
    assert "✓  The redesign worked" in text
    assert "redesigned gains perform as predicted: errors and surfaces 1.0 to 1.0 times" in text


def test_verdict_larger_errors_without_alarm_are_measured() -> None:
    """Heading 1.7 times the prediction was reported as "perform as predicted"."""
    larger = {"straight_run": monitored(heading_deg=1.7, rudder_deg=1.6, pitch_deg=1.2)}
    text = card(replace(campaign(), monitoring=larger))
    assert "heading 1.7 times and rudder 1.6 times the predicted rms" in text
    assert "perform as predicted" not in text


def tracked(*depth_errors_m: float) -> TrackingMetrics:
    """Return tracking errors of legs with these 95 % errors of depth."""
    metrics = SUMMARY.tracking["straight_run"]["initial"]
    (window,) = metrics.windows
    windows = [
        replace(window, heading_deg=SPREAD, depth_m=replace(SPREAD, p95=error))
        for error in depth_errors_m
    ]
    return replace(metrics, windows=tuple(windows))


def test_verdict_unsettled_legs_are_named_beside_the_first_gains() -> None:
    """A campaign of slow_survey missed 3 m on every leg of `combined`, and had worked."""
    sets = {"initial": tracked(1.4, 0.6, 123.4), "redesigned": tracked(0.1, 0.2, 0.79)}
    found = replace(campaign(), tracking={"combined": sets})
    said = "depth does not settle on 1 of 3 legs: 95 % error 0.79 m, at most 0.5 m"
    for text in (card(found), summary.format_text(found, Path())):
        assert f"ombined: {said}, with the initial gains 123 m" in text
    assert "✓" not in card(found)
    assert "Next:  Give the legs that do not settle more time" in card(found)
    settled = {"initial": tracked(1.4, 0.6, 1.7), "redesigned": tracked(0.1, 0.2, 0.3)}
    assert "settle" not in card(replace(found, tracking={"combined": settled}))


def test_verdict_without_steady_flight_confirms_no_prediction() -> None:
    shallow = replace(monitored(), windows=0)
    text = card(replace(campaign(), monitoring={"shallow_1m": shallow}))
    assert "perform as predicted" not in text
    assert "No dive had enough steady flight" in text


def test_verdict_small_errors_have_significant_digits() -> None:
    """The fixed digits gave "0.1 → 0.0°" and "2 → 0 cm" for a vehicle of 3 kg."""
    before = SteadyErrorEntry(heading_deg=0.12, pitch_deg=0.5, depth_m=0.0248)
    after = SteadyErrorEntry(heading_deg=0.042, pitch_deg=0.5, depth_m=0.004)
    text = card(campaign(initial=before, redesigned=after))
    assert "Heading error 0.12 → 0.042°" in text
    assert "depth error 2.5 → 0.4 cm" in text


def test_verdict_first_gains_kept_names_the_reason() -> None:
    same = SteadyErrorEntry(heading_deg=0.3, pitch_deg=0.5, depth_m=0.07)
    found = campaign(KEPT, same, same)
    text, console = card(found), summary.format_text(found, Path())
    assert "The first gains are kept" in text
    assert "hold depth (2.11 times) worse" in text
    for said in (text, console):
        assert "kept gains perform as predicted" in said
        assert "redesigned gains" not in said
    assert "✓" not in text
    assert "smaller" not in text
    assert re.match(r"steady error, 95 % +initial +kept\b", console)


def test_verdict_first_gains_kept_are_no_larger_error() -> None:
    """Two dives with the same gains differ by chance."""
    before = SteadyErrorEntry(heading_deg=0.3, pitch_deg=0.5, depth_m=0.07)
    after = SteadyErrorEntry(heading_deg=0.31, pitch_deg=0.5, depth_m=0.08)
    assert "grown" not in card(campaign(KEPT, before, after))


def test_verdict_relaxed_limits_are_named() -> None:
    text = card(campaign(RELAXED))
    assert "The redesign worked" in text
    assert "GM 7 dB, PM 45 deg" in text
