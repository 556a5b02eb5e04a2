"""The reproduction as a whole: every table and figure with its verdict, as text and as JSON."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from rich import box
from rich.console import RenderableType
from rich.table import Table

from ground.paper import figure_rows, table_rows
from ground.paper.flights import PaperFlights
from ground.rendered import Rendered
from ground.report import paper_poles
from ground.report.paper_poles import PolesComparison
from ground.terminal import heading, render
from sysid.design import initial
from sysid.planes import Plane
from sysid.reproduction import discrepancies, table_comparisons
from sysid.reproduction.comparison import PublishedComparison, Value, Verdict
from sysid.reproduction.discrepancies import Discrepancy, Sources
from sysid.reproduction.paper_method import PlaneFit

WIDTH = 150
"""Width of the tables in characters."""
ITEMS = (*(f"Table {n}" for n in range(1, 6)), *(f"Figure {n}" for n in range(4, 16)))
"""Tables and figures with contents that can be compared; Figures 1 to 3 are pictures."""
PARTLY = "reproduced as far as the paper allows"
"""Verdict of a table or figure of which some quantities are not reproducible."""
NOT_FLOWN = "not flown"
"""Verdict of a table or figure whose flights were left out."""


class Reproduction(NamedTuple):
    """Result of `ground paper`."""

    comparisons: list[PublishedComparison]
    discrepancies: list[Discrepancy]
    poles: PolesComparison
    derivation: str
    """Derivation of Table 1's initial column as text."""
    flown: bool
    """Whether the quantities that need flights are included."""

    def verdict(self, item: str) -> str:
        """Return the verdict of a table or figure: of its quantities, or what is missing."""
        verdicts = {row.verdict for row in self.comparisons if row.item == item}
        if not verdicts:
            return NOT_FLOWN
        if Verdict.NOT_REPRODUCED in verdicts:
            return Verdict.NOT_REPRODUCED
        return PARTLY if len(verdicts) > 1 else verdicts.pop()

    @property
    def failures(self) -> list[str]:
        """Quantities that can be reproduced and were not, and places that were not confirmed."""
        missed = [
            f"{row.item}, {row.quantity}"
            for row in self.comparisons
            if row.verdict is Verdict.NOT_REPRODUCED
        ]
        return missed + [entry.place for entry in self.discrepancies if not entry.confirmed]


def reproduce(
    flights: PaperFlights | None = None, fits: dict[Plane, PlaneFit] | None = None
) -> Reproduction:
    """Compare every table and figure, and compute the evidence of the garbled places.

    Parameters
    ----------
    flights : PaperFlights, optional
        Flights; without them only what follows from the printed numbers is compared.
    fits : dict, optional
        Result of `figure_rows.adjust_model`; needed with flights.

    Returns
    -------
    Reproduction
        Comparisons in the order of the paper's numbers.
    """
    poles, steps = paper_poles.compute(), table_comparisons.derivation()
    tables_1 = [*table_comparisons.table_1_initial(steps), table_comparisons.table_1_changes()]
    tables_2, tables_3, tables_5, figures = _from_flights(flights, fits)
    if flights is not None:
        tables_1 += table_rows.table_1_adjusted(flights.campaign)
    design = initial.design_initial_gains(table_comparisons.NOMINAL_VEHICLE)
    sources = Sources({step.symbol: step for step in steps}, poles.readings, poles.alone)
    return Reproduction(
        comparisons=[
            *tables_1,
            *tables_2,
            *table_comparisons.table_3_initial(design),
            *tables_3,
            *table_comparisons.table_4(poles.rows, poles.readings, poles.alone),
            *tables_5,
            *figures,
        ],
        discrepancies=discrepancies.all_discrepancies(sources),
        poles=poles,
        derivation=table_comparisons.derivation_text(),
        flown=flights is not None,
    )


def _from_flights(
    flights: PaperFlights | None, fits: dict[Plane, PlaneFit] | None
) -> tuple[Sequence[PublishedComparison], ...]:
    """Return the comparisons of Tables 2, 3 (improved) and 5 and of the figures."""
    if flights is None or fits is None:
        return (), (), (), ()
    return (
        table_rows.table_2(flights.campaign),
        table_rows.table_3_improved(flights.campaign),
        table_rows.table_5(flights),
        figure_rows.all_figures(flights, fits),
    )


def as_json(result: Reproduction) -> dict[str, Any]:
    """Return the reproduction as plain values.

    Parameters
    ----------
    result : Reproduction
        Result of `reproduce`.

    Returns
    -------
    dict
        Verdicts by item, comparisons, discrepancies, poles and derivation.
    """
    return {
        "reproduced": not result.failures,
        "flown": result.flown,
        "failures": result.failures,
        "items": {item: result.verdict(item) for item in ITEMS},
        "comparisons": [
            {**row._asdict(), "difference": row.difference if row.difference != "" else None}
            for row in result.comparisons
        ],
        "discrepancies": [entry._asdict() for entry in result.discrepancies],
        **paper_poles.as_json(result.poles),
        "derivation": result.derivation,
    }


def format_text(result: Reproduction) -> Rendered:
    """Return the reproduction as text: one table per item, and the garbled places.

    Parameters
    ----------
    result : Reproduction
        Result of `reproduce`.

    Returns
    -------
    Rendered
        Text for a terminal.
    """
    parts: list[RenderableType] = []
    for item in ITEMS:
        rows = [row for row in result.comparisons if row.item == item]
        parts += [heading(f"{item}: {result.verdict(item)}"), *([_table(rows)] if rows else [])]
    parts += [heading("Garbled and inconsistent places"), _places(result.discrepancies)]
    page = render(parts, WIDTH)
    lines = [line.rstrip() for line in page.split("\n") if line.strip()]
    poles = paper_poles.format_lines(result.poles)
    derived = ["Table 1's initial column from first principles", result.derivation]
    return Rendered("\n".join([*lines, "", *poles, "", *derived, "", summary_line(result)]))


def summary_line(result: Reproduction) -> str:
    """Return the number of quantities by verdict in one line."""
    counts = {v: sum(row.verdict is v for row in result.comparisons) for v in Verdict}
    confirmed = sum(entry.confirmed for entry in result.discrepancies)
    quantities = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    return (
        f"{len(result.comparisons)} quantities: {quantities};"
        f" {confirmed} of {len(result.discrepancies)} garbled places confirmed"
    )


def format_value(value: Value, unit: str) -> str:
    """Return a number with five digits and its unit, or a text unchanged."""
    return value if isinstance(value, str) else f"{value:.5g} {unit}".rstrip()


def format_difference(row: PublishedComparison) -> str:
    """Return the difference with its sign; a relative one where the published value is not 0."""
    if isinstance(row.difference, str):
        return row.difference
    if isinstance(row.published, str) or row.published == 0.0:
        return f"{row.difference:+.3g}"
    return f"{100.0 * row.difference / abs(row.published):+.1f} %"


def _table(rows: Sequence[PublishedComparison]) -> Table:
    """Return the comparisons of one item as a table."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("quantity", "published", "ours", "diff.", "verdict", "criterion, reason"):
        table.add_column(name, overflow="fold")
    for row in rows:
        table.add_row(
            row.quantity,
            format_value(row.published, row.unit),
            format_value(row.ours, row.unit),
            format_difference(row),
            row.verdict,
            "; ".join(filter(None, (row.criterion, row.reason))),
        )
    return table


def _places(entries: Sequence[Discrepancy]) -> Table:
    """Return the garbled places as a table."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("place", "printed", "reading", "evidence", ""):
        table.add_column(name, overflow="fold")
    for entry in entries:
        table.add_row(
            entry.place,
            entry.printed,
            entry.reading,
            entry.evidence,
            "confirmed" if entry.confirmed else "not confirmed",
        )
    return table
