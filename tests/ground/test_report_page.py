"""The report in a real browser: charts keep their height at every size of the window."""

import re
from collections.abc import Iterator
from importlib.resources import files

import numpy as np
import pytest

from ground.report import charts, page, tables
from ground.report.figures import Curve, Figure, Panel
from sysid.models.model_file import Coefficient
from tests.browser import (
    HEIGHT_TOLERANCE_PX,
    WINDOWS_PX,
    Page,
    check_layout,
    check_print,
    needs_chromium,
    opened,
)

MIN_PLOT_PX = (200.0, 60.0)
"""Width and height of the axes at 390 px: smaller ones cannot be read."""
COEFFICIENT = Coefficient(
    value=0.9,
    sd=0.1,
    prior=1.0,
    prior_sd=0.2,
    posterior_to_prior_sd=0.5,
    status="measured",
    unit="kg/s",
)
PARTS = """
const box = (e) => e.getBoundingClientRect();
return [...document.querySelectorAll('.chart')].map(chart => {
  const [place, axes] = [box(chart), box(chart.querySelector('.nsewdrag'))];
  const cut = [...chart.querySelectorAll('.xtitle, .legend, .legend .scrollbar')].filter(e =>
    box(e).right > place.right || box(e).left < place.left || box(e).top < place.top
    || (e.matches('.scrollbar') && box(e).height > 0));
  return { key: chart.id, width: axes.width, height: axes.height,
           below_legend: axes.top - box(chart.querySelector('.legend')).bottom,
           cut_off: cut.map(e => e.getAttribute('class')) };
});
"""
"""JavaScript: for each chart the size of its first axes, the space to the legend, what is cut."""


def figure(key: str, panels: int) -> Figure:
    """Return a figure with the longest labels that a campaign's figures have."""
    x = np.arange(50.0)
    names = ("incl. sea and sensors, 95 %", "refitted model", "measured", "initial model")
    roles = ("redesigned", "redesigned", "measured", "initial")
    curves = tuple(
        Curve(name, role, x, np.sin(x / 9.0 + number))
        for number, (name, role) in enumerate(zip(names, roles, strict=True))
    )
    shown = tuple(Panel(f"panel {number}", "deg", curves) for number in range(panels))
    return Figure(key, f"Figure {key}", "A note.", "seconds since the vehicle was armed", shown)


def small_report() -> str:
    """Return a page with every kind of chart, and a table wider than a telephone."""
    wide, pair = figure("wide", 5), [figure(f"pair-{panels}", panels) for panels in (1, 2)]
    poles = {role: {"heading": [[-1.0, 1.8], [-1.0, -1.8]]} for role in ("initial", "redesigned")}
    coefficients = ("Y_v", "Y_r", "N_v", "N_r", "M_q", "Z_w", "Y_dr", "M_de")
    known = dict.fromkeys(coefficients, COEFFICIENT)
    drawn = {each.key: charts.figure_chart(each) for each in (wide, *pair)}
    drawn |= {"poles-heading": charts.poles_chart(poles, "heading")}
    drawn |= {
        "estimates": charts.estimates_chart(known),
        "posterior": charts.posterior_chart(known),
    }
    template = (files("ground.report") / "page.html").read_text(encoding="utf-8")
    names = re.findall(r"\$(\w+)", template)
    row = ["a name", *["12.345 → 6.789"] * 8, "a reason of many words, broken at the line's end"]
    parts = dict.fromkeys(names, "") | {
        "title": "A small report",
        "headline": '<div><span class="big">1.2° → 0.9°</span></div>' * 3,
        "missions": page.place_figure(wide),
        "steps": "".join(map(page.place_figure, pair)),
        "poles": page.places({"poles-heading": "Heading loop"}),
        "tracking": tables.table(["", *["a column"] * 8, "reason"], [row] * 3, "prose"),
        "asked": "x" * 200,
    }
    return page.render(parts, drawn)


FIRST = """
new MutationObserver((_, observer) => {
  const drawn = [...document.querySelectorAll('.chart')].filter(e => e.querySelector('.main-svg'));
  if (drawn.length) { window.drawnAtFirst = drawn.length; observer.disconnect(); }
}).observe(document, { childList: true, subtree: true });
"""
"""Counts the charts that are drawn when the browser can first show one."""


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    folder = tmp_path_factory.mktemp("report")
    (folder / "report.html").write_text(small_report(), encoding="utf-8")
    with opened(folder / "report.html", folder / "profile") as page_shown:
        yield page_shown


@needs_chromium
@pytest.mark.process
@pytest.mark.timeout(120)
class BrowserTestCase:
    def test_report_resized_and_turned_keeps_its_layout(self, shown: Page) -> None:
        check_layout(shown)

    def test_report_narrow_leaves_room_for_the_plots(self, shown: Page) -> None:
        shown.resize(390, 844)
        parts = shown.run(PARTS)
        assert {part["key"] for part in parts} == set(shown.charts())
        for part in parts:
            assert part["width"] >= MIN_PLOT_PX[0], part
            assert part["height"] >= MIN_PLOT_PX[1], part
            assert part["below_legend"] >= -1.0, part
            assert part["cut_off"] == [], part

    def test_first_chart_is_shown_before_the_last_is_drawn(self, shown: Page) -> None:
        shown.run_at_next_opening(FIRST)
        shown.open(shown.run("return location.href"), *WINDOWS_PX[-1])
        assert shown.run("return window.drawnAtFirst") == 1
        assert len(shown.charts()) > 3

    def test_report_printed_keeps_headings_with_charts(self, shown: Page) -> None:
        check_print(shown)

    def test_print_from_a_narrow_window_keeps_the_sizes_of_the_paper(self, shown: Page) -> None:
        """The paper is wider than the window, so that the layout of wide windows begins."""
        shown.resize(*WINDOWS_PX[-1])
        shown.run("dispatchEvent(new Event('beforeprint'))")
        expected = shown.chart_heights()
        shown.run("dispatchEvent(new Event('afterprint'))")
        shown.resize(390, 844)
        shown.run("dispatchEvent(new Event('beforeprint'))")
        shown.resize(700, 950)
        printed = shown.chart_heights()
        shown.run("dispatchEvent(new Event('afterprint'))")
        assert printed == pytest.approx(expected, abs=HEIGHT_TOLERANCE_PX)

    def test_legend_after_resizing_is_above_the_plot(self, shown: Page) -> None:
        """A legend that is placed by the axes stays where the last width had put it."""
        for window in WINDOWS_PX:
            shown.resize(*window)
            parts = shown.run(PARTS)
            assert [part for part in parts if part["below_legend"] < -1.0] == []
