"""HTML page of the reproduction: one file that needs no network."""

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from ground.paper import reproduction
from ground.paper.reproduction import ITEMS, Reproduction
from ground.report import charts, page, tables
from ground.report.figures import Figure
from mavlink_io.user_data_dir import write_output
from sysid.reproduction.comparison import PublishedComparison, Verdict

TITLE = "Caribou: the paper, rebuilt"
_TAGS = {Verdict.REPRODUCED: "measured", Verdict.NOT_REPRODUCED: "prior"}
"""CSS class of a verdict."""


def write(result: Reproduction, drawn: Sequence[Figure], target: Path) -> Path:
    """Write the page.

    Parameters
    ----------
    result : Reproduction
        Comparisons and garbled places.
    drawn : Sequence of Figure
        Figures with curves; empty without flights.
    target : Path
        HTML file to write.

    Returns
    -------
    Path
        `target`.
    """
    by_item = {f"Figure {figure.key.removeprefix('figure-')}": figure for figure in drawn}
    parts = {
        "title": escape(TITLE),
        "lead": escape(reproduction.summary_line(result)),
        "items": "".join(_item(item, result, by_item.get(item)) for item in ITEMS),
        "places": tables.table(
            ["place", "printed", "reading", "evidence", ""],
            [
                [
                    *map(escape, (entry.place, entry.printed, entry.reading, entry.evidence)),
                    "confirmed" if entry.confirmed else "not confirmed",
                ]
                for entry in result.discrepancies
            ],
            "named prose",
        ),
        "derivation": escape(result.derivation),
    }
    shown = {figure.key: charts.figure_chart(figure) for figure in drawn}
    template = files("ground.paper") / "page.html"
    write_output(target, page.render(parts, shown, template))
    return target


def _item(item: str, result: Reproduction, figure: Figure | None) -> str:
    """Return one table or figure with its verdict."""
    rows = [row for row in result.comparisons if row.item == item]
    chart = "" if figure is None else f'<div class="chart" id="{figure.key}"></div>'
    head = ["quantity", "published", "ours", "difference", "verdict", "criterion, reason"]
    body = tables.table(head, map(_row, rows), "named prose") if rows else ""
    return f"<h2>{item}: {escape(result.verdict(item))}</h2>{chart}{body}"


def _row(row: PublishedComparison) -> list[str]:
    """Return one comparison as HTML cells."""
    texts = (
        row.quantity,
        reproduction.format_value(row.published, row.unit),
        reproduction.format_value(row.ours, row.unit),
        reproduction.format_difference(row),
    )
    tag = f'<span class="tag {_TAGS.get(row.verdict, "")}">{row.verdict}</span>'
    why = escape("; ".join(filter(None, (row.criterion, row.reason))))
    return [*map(escape, texts), tag, why]
