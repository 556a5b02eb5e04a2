"""Tables of the campaign's report."""

from types import SimpleNamespace
from typing import Any, cast

from ground.report import tables
from sysid.models.model_file import IdentifiedModel, RunQuality, ScreenedRun
from sysid.planes import Plane


def screened(run: str, *reasons: str) -> ScreenedRun:
    return ScreenedRun(
        run=run,
        plane=Plane.YAW,
        wave="step",
        magnitude_deg=-4.0,
        duration_s=20.0,
        accepted=not reasons,
        reasons=reasons,
        warnings=(),
    )


def quality(run: str) -> RunQuality:
    return RunQuality(run, Plane.YAW, 0.2, 0.1, 0.2, 0.1, 0.9)


def test_runs_table_shows_held_out_runs_with_size_and_reason() -> None:
    model: Any = SimpleNamespace(
        screening=(screened("steps/1"),),
        held_out_screening=(screened("heldout/1"), screened("heldout/2", "gap: 2 < 3 s")),
        fit_quality=(quality("steps/1"),),
        held_out=(quality("heldout/1"),),
    )
    page = tables.screening(cast(IdentifiedModel, model))
    _head, fitted, held_out, rejected = page.split("<tr>")[1:]
    assert "fitted" in fitted
    for text in ("heldout/1", "step -4\N{DEGREE SIGN}", "20.0 s", "0.200", "0.100", "held out"):
        assert f">{text}<" in held_out
    assert "rejected" in rejected
    assert "<td></td><td></td>" in rejected
    assert "gap: 2 &lt; 3 s" in rejected
