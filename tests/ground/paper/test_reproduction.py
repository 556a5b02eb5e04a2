"""Verdicts of whole tables and figures, and comparisons that must fail on wrong flights."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ground.paper import figure_rows, flights, page, table_rows
from ground.paper.flights import PaperFlights, PaperRequest
from ground.paper.reproduction import NOT_FLOWN, PARTLY, Reproduction, reproduce
from ground.report.figures import Curve, Figure, Panel
from mavlink_io.errors import InputError
from mavlink_io.vehicle_modes import VehicleMode
from sysid.data.events import ModeChanged
from sysid.monitor.tracking_metrics import Spread, SteadyWindow
from sysid.planes import Plane
from sysid.reproduction.comparison import PublishedComparison, Verdict, statement, within
from sysid.reproduction.discrepancies import Discrepancy
from tests.browser import needs_chromium, opened


def result(*rows: PublishedComparison, confirmed: bool = True) -> Reproduction:
    entry = Discrepancy("a place", "printed", "reading", "evidence", {"x": 1.0}, confirmed)
    return Reproduction(list(rows), [entry], None, "derivation", True)  # type: ignore[arg-type]


GOOD = statement("Table 5", "held", "yes", "yes", holds=True)
BAD = statement("Table 5", "held in swell", "yes", "no", holds=False)
UNKNOWN = within("Table 5", "depth", "m", 1.0, 2.0, share=0.1, impossible="no sea is given")


def test_verdict_of_item_is_that_of_its_quantities() -> None:
    assert result(GOOD).verdict("Table 5") == Verdict.REPRODUCED
    assert result(GOOD, UNKNOWN).verdict("Table 5") == PARTLY
    assert result(UNKNOWN).verdict("Table 5") == Verdict.NOT_REPRODUCIBLE
    assert result(GOOD, UNKNOWN, BAD).verdict("Table 5") == Verdict.NOT_REPRODUCED
    assert result(GOOD).verdict("Figure 7") == NOT_FLOWN


def test_failures_are_misses_and_unconfirmed_places() -> None:
    assert result(GOOD, UNKNOWN).failures == []
    assert result(BAD).failures == ["Table 5, held in swell"]
    assert result(GOOD, confirmed=False).failures == ["a place"]


def test_page_shows_figure_and_escapes_text(tmp_path: Path) -> None:
    x = np.arange(3.0)
    panel = Panel("depth", "m", (Curve("measured", "measured", x, x),))
    figure = Figure("figure-7", "Figure 7", "", "s", (panel,))
    row = statement("Figure 7", "<step>", "a", "b", holds=True)
    html = page.write(result(row), [figure], tmp_path / "paper.html").read_text(encoding="utf-8")
    assert 'id="figure-7"' in html
    assert "&lt;step&gt;" in html
    assert "<step>" not in html


@needs_chromium
@pytest.mark.process
def test_tables_fit_a_wide_window(tmp_path: Path) -> None:
    """The last column contains the reason of a verdict."""
    target = page.write(reproduce(), [], tmp_path / "paper.html")
    with opened(target, tmp_path / "profile") as shown:
        shown.resize(1600, 1200)
        cut = shown.run(
            "return [...document.querySelectorAll('.scroll')]"
            ".filter(e => e.scrollWidth > e.clientWidth)"
            ".map(e => e.previousElementSibling.innerText)"
        )
    assert cut == []


def window(heading_deg: float, pitch_deg: float, depth_m: float) -> SteadyWindow:
    spreads = [Spread(p95, p95, p95, 0.0) for p95 in (heading_deg, pitch_deg, depth_m)]
    return SteadyWindow(0.0, 1.0, 0.0, 0.0, *spreads)


class Flown:
    """Steady errors of three sets of gains."""

    def __init__(self, improved_depth_m: float, redesigned_depth_m: float) -> None:
        self.windows = {
            "initial": window(2.0, 8.0, 0.4),
            "improved": window(1.5, 2.0, improved_depth_m),
            "redesigned": window(1.0, 1.0, redesigned_depth_m),
        }

    def steady(self, role: str) -> SteadyWindow:
        return self.windows[role]


@pytest.mark.parametrize(
    ("improved_m", "ours_m", "verdict", "our_verdict"),
    [
        (0.09, 0.05, Verdict.REPRODUCED, Verdict.REPRODUCED),
        (0.14, 0.05, Verdict.NOT_REPRODUCIBLE, Verdict.REPRODUCED),
        (0.14, 0.12, Verdict.NOT_REPRODUCIBLE, Verdict.NOT_REPRODUCED),
    ],
)
def test_table_5_excuses_a_miss_only_by_the_papers_own_model(
    improved_m: float, ours_m: float, verdict: Verdict, our_verdict: Verdict
) -> None:
    """Tables 1 and 3 contradict the printed depth error; a redesign has no such excuse."""
    rows: Any = {
        row.quantity: row
        for row in table_rows.table_5(Flown(improved_m, ours_m))  # type: ignore[arg-type]
    }
    assert rows["depth error, Table 3's improved gains"].verdict is verdict
    assert rows["depth error, our redesign"].verdict is our_verdict
    assert rows["pitch, our redesign"].verdict is Verdict.REPRODUCED


def test_joint_interval_is_wider_than_a_single_one() -> None:
    """Reference: Bonferroni, tables of the normal distribution: 1.960 and 2.807 for 10."""
    assert table_rows.joint_sds(1) == pytest.approx(1.960, abs=1e-3)
    assert table_rows.joint_sds(10) == pytest.approx(2.807, abs=1e-3)


def test_campaign_without_papers_gains_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = SimpleNamespace(
        prior="caribou_nominal", summary=SimpleNamespace(gains={"initial": {}})
    )
    monkeypatch.setattr(flights, "CampaignFolder", lambda _: folder)
    with pytest.raises(InputError, match="--include-paper-gains"):
        flights.fly(PaperRequest(tmp_path, tmp_path), lambda *_: None, lambda _: None)
    folder.prior = "remus100"
    with pytest.raises(InputError, match="flew remus100"):
        flights.fly(PaperRequest(tmp_path, tmp_path), lambda *_: None, lambda _: None)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> PaperFlights:
    """Bench test and figure 7's dive, without a campaign."""
    summary = SimpleNamespace(trims={"TRIM_RUD_DEG": 6.0, "TRIM_ELE_DEG": 0.4})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flights, "_campaign", lambda *_: SimpleNamespace(summary=summary))
        request = PaperRequest(tmp_path_factory.mktemp("paper"))
        return flights.fly(request, lambda *_: None, lambda _: None)


@pytest.mark.process
@pytest.mark.slow
def test_figure_4_bench_is_reproduced_and_wrong_delay_is_not(flown: PaperFlights) -> None:
    rows = figure_rows.figure_4(flown.bench)
    assert {row.verdict for row in rows} == {Verdict.REPRODUCED}
    delay = flown.bench.model.delay_s
    model = flown.bench.model._replace(delay_s=type(delay)(0.2, delay.sd))
    wrong = figure_rows.figure_4(flown.bench._replace(model=model))
    assert [row.quantity for row in wrong if row.verdict is not Verdict.REPRODUCED] == ["delay"]


@pytest.mark.process
@pytest.mark.slow
def test_figure_7_bias_is_reproduced_and_unbiased_duct_is_not(flown: PaperFlights) -> None:
    steps = flown.bias_steps
    assert {row.verdict for row in figure_rows.figure_7(steps)} == {Verdict.REPRODUCED}
    straight = steps._replace(rudder_rad=steps.rudder_rad + np.radians(6.0))
    missed = [r.quantity for r in figure_rows.figure_7(straight) if r.verdict != GOOD.verdict]
    assert missed == ["step to 5 deg: actual deflection", "step to 7 deg: actual deflection"]


def test_figure_6_needs_falling_error_and_yaw_first() -> None:
    def fit(*history: float) -> Any:
        return SimpleNamespace(history_deg2ps2=history, rank=4)

    good = figure_rows.figure_6({Plane.YAW: fit(2.0, 1.0), Plane.PITCH: fit(3.0, 1.0)})
    assert {row.verdict for row in good} == {Verdict.REPRODUCED}
    bad = figure_rows.figure_6({Plane.PITCH: fit(2.0), Plane.YAW: fit(3.0, 1.0)})
    assert [row.verdict for row in bad] == [
        Verdict.NOT_REPRODUCED,
        Verdict.REPRODUCED,
        Verdict.NOT_REPRODUCED,
    ]


def test_depth_change_errors_end_before_the_ascent() -> None:
    """The set-point of 0 m is sent after the mode changed to SURFACE, which ends the mission."""
    time_s = np.arange(0.0, 140.0, 0.1)
    steps_s, depths_m = np.array([0.1, 70.1, 130.1]), np.array([2.0, 5.0, 0.0])
    setpoints = SimpleNamespace(depth_time_s=steps_s, depth_m=depths_m)
    depth = SimpleNamespace(time_s=time_s, depth_m=np.where(time_s < 70.1, 2.0, 5.1))
    event = SimpleNamespace(time_s=130.02, value=ModeChanged(VehicleMode.SURFACE))
    log: Any = SimpleNamespace(
        setpoints=setpoints, depth=depth, events=[event], attitude=SimpleNamespace(time_s=time_s)
    )
    errors_m = figure_rows._change_errors(log)
    assert list(errors_m.values()) == pytest.approx([0.1, 0.1, 0.1])
