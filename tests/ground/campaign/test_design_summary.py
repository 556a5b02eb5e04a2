"""Rows of limits and reached values of a design."""

from html.parser import HTMLParser

import msgspec
import pytest

from ground.campaign import design_summary
from ground.campaign.summary_file import DesignSummary, LoopAnalysis, MarginsSummary
from ground.report import page, tables
from sysid.control_analysis.control_systems import MarginsComparison
from sysid.control_analysis.loop_transfer import Margins
from sysid.design.pid import DesignRobustness, Response, Spec
from sysid.design.specification import MinimumVariance
from sysid.monitor import MonitorReport

PITCH_MARGINS = MarginsSummary(gm_db=None, pm_deg=None, max_sensitivity=1.2, crossover_radps=1.0)
ROBUSTNESS = DesignRobustness(0.8333, 0.99, "damping of the heading loop", 240)


def margins(gm_db: float | None, pm_deg: float | None, max_sensitivity: float) -> MarginsSummary:
    return MarginsSummary(
        gm_db=gm_db, pm_deg=pm_deg, max_sensitivity=max_sensitivity, crossover_radps=1.0
    )


def design(
    pitch: MarginsSummary = PITCH_MARGINS, robustness: DesignRobustness | None = ROBUSTNESS
) -> DesignSummary:
    """Return a design with given margins at the pitch error, and given robustness."""
    analysis = LoopAnalysis(
        damping={"heading": 0.66, "depth": 0.61},
        poles_radps={},
        visible_modes_radps={},
        margins={
            "rudder": margins(9.8, 59.0, 1.6),
            "elevator": margins(11.9, 55.2, 1.46),
            "pitch": pitch,
        },
        predicted=Response(0.4, 0.4, 0.03, 0.6, 0.6),
    )
    return DesignSummary(
        redesigned=analysis,
        initial=analysis,
        gains={"HDG_P": 0.8046},
        reasons={"HDG_P": "GM 9.8 dB < infinity"},
        specification=Spec(),
        robustness=robustness,
        predicted={},
        minimum_variance=MinimumVariance(0.02, 0.03, 0.004, 0.2, 0.012),
        model_sha256="ab" * 32,
    )


def test_rows_show_worst_loop_and_point() -> None:
    rows = {row.limit: row for row in design_summary.rows(design())}
    assert rows["damping"][1:] == (">= 0.6", "0.61", "depth")
    assert rows["gain margin, dB"][1:] == (">= 8", "9.8", "rudder")
    assert rows["phase margin, deg"][1:] == (">= 55", "55", "elevator")
    assert rows["largest sensitivity"][1:] == ("<= 1.6", "1.60", "rudder")
    assert rows["vehicles that meet it"].reached == "83 %"
    assert "most others miss the damping of the heading loop" in rows["vehicles that meet it"].where


def test_rows_count_the_damping_that_the_design_limits() -> None:
    """The pitch loop without the depth loop was counted: ">= 0.6  0.43 pitch" of a sound design."""
    analysis = design().redesigned
    damping = {**analysis.damping, "pitch": 0.43}
    alone = msgspec.structs.replace(analysis, damping=damping)
    rows = {
        row.limit: row
        for row in design_summary.rows(msgspec.structs.replace(design(), redesigned=alone))
    }
    assert rows["damping"][1:] == (">= 0.6", "0.61", "depth")
    assert rows["damping of pitch alone"][1:3] == ("", "0.43")
    assert rows["damping of pitch alone"].where.startswith("not limited")


def test_rows_contain_pitch_point() -> None:
    """The specification limits every cut whose margins are reported."""
    weak_pitch = design(pitch=margins(7.0, 50.0, 1.9))
    rows = {row.limit: row for row in design_summary.rows(weak_pitch)}
    assert rows["gain margin, dB"].where == "pitch"
    assert rows["phase margin, deg"].where == "pitch"
    assert rows["largest sensitivity"][1:] == ("<= 1.6", "1.90", "pitch")


def test_page_marks_margins_that_differ() -> None:
    analysis = design().redesigned
    margins_of_control = dict.fromkeys(analysis.margins, Margins(9.87, 54.4, 1.59, 0.9))
    second = MarginsComparison(margins_of_control, {"pitch": "pm_deg at pitch: 55"})
    roles = ("initial", "redesigned")
    page = tables.margins(dict.fromkeys(roles, analysis), dict.fromkeys(roles, second))
    assert page.count("9.9 dB, 54°, 1.59") == 2 * len(analysis.margins)
    assert page.count(">differs<") == 2


def test_rows_unknown_robustness_is_reported() -> None:
    *_, last = design_summary.rows(design(robustness=None))
    assert last.reached == ""
    assert "the model has no covariance" in last.where


def test_page_escapes_text(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    reader = HTMLParser()
    monkeypatch.setattr(reader, "handle_data", told.append)
    reader.feed(page.specification(design()) + page.reasons(design()))
    assert ">= 0.6" in told
    assert "GM 9.8 dB < infinity" in told


def test_page_mission_without_steady_flight_has_no_values() -> None:
    report = MonitorReport(
        windows=0, steady_s=0.0, rms={}, causes=(), detected_at_s=None, refit_recommended=False
    )
    assert page.monitoring({"shallow_1m": report}).count("–") == 5
