"""Rows of limits and reached values of a design."""

from html.parser import HTMLParser
from typing import Any

import pytest

from ground.campaign import design_summary
from ground.report import page, tables
from sysid.design.pid import DesignRobustness, Spec


def margins(gm_db: float | None, pm_deg: float | None, ms: float) -> dict[str, float | None]:
    return {"gm_db": gm_db, "pm_deg": pm_deg, "ms": ms, "crossover_radps": 1.0}


@pytest.fixture
def design() -> dict[str, Any]:
    cuts = {
        "rudder": margins(9.8, 59.0, 1.6),
        "elevator": margins(11.9, 55.2, 1.46),
        "pitch": margins(None, None, 1.2),
    }
    return {
        "specification": Spec()._asdict(),
        "redesigned": {"damping": {"heading": 0.66, "depth": 0.61}, "margins": cuts},
        "trust": DesignRobustness(0.8333, 0.99, "damping of the heading loop", 240)._asdict(),
        "gains": {"HDG_P": 0.8046},
        "reasons": {"HDG_P": "GM 9.8 dB < infinity"},
    }


def test_rows_show_worst_loop_and_point(design: dict[str, Any]) -> None:
    rows = {row.limit: row for row in design_summary.rows(design)}
    assert rows["damping"][1:] == (">= 0.6", "0.61", "depth")
    assert rows["gain margin, dB"][1:] == (">= 8", "9.8", "rudder")
    assert rows["phase margin, deg"][1:] == (">= 55", "55", "elevator")
    assert rows["largest sensitivity"][1:] == ("<= 1.6", "1.60", "rudder")
    assert rows["vehicles that meet it"].reached == "83 %"
    assert "most others miss the damping of the heading loop" in rows["vehicles that meet it"].where


def test_rows_ignore_pitch_point(design: dict[str, Any]) -> None:
    """The specification limits four cuts (`sysid/design/heading.py`, `depth.py`); pitch is not
    one.
    """
    design["redesigned"]["margins"]["pitch"] = margins(7.0, 50.0, 1.9)
    rows = {row.limit: row for row in design_summary.rows(design)}
    assert rows["gain margin, dB"].where == "rudder"
    assert rows["phase margin, deg"].where == "elevator"
    assert rows["largest sensitivity"][1:] == ("<= 1.6", "1.60", "rudder")


def test_page_marks_point_without_limit(design: dict[str, Any]) -> None:
    cuts = design["redesigned"]["margins"]
    page = tables.margins({"initial": {"margins": cuts}, "redesigned": {"margins": cuts}})
    assert "pitch, not limited" in page
    assert "rudder, not limited" not in page


def test_rows_unknown_robustness_is_reported(design: dict[str, Any]) -> None:
    *_, last = design_summary.rows({**design, "trust": None})
    assert last.reached == ""
    assert "--prior" in last.where


def test_page_escapes_text(design: dict[str, Any]) -> None:
    told: list[str] = []
    reader = HTMLParser()
    reader.handle_data = told.append  # type: ignore[method-assign]
    reader.feed(page.specification(design) + page.reasons(design))
    assert ">= 0.6" in told
    assert "GM 9.8 dB < infinity" in told


def test_page_mission_without_steady_flight_has_no_values() -> None:
    kept = {
        "blocks": 0,
        "steady_s": 0.0,
        "rms": {},
        "causes": [],
        "found_s": None,
        "refit_due": False,
    }
    assert page.monitoring({"shallow_1m": kept}).count("–") == 5
