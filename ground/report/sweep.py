"""Report of a sweep: text, CSV and an HTML page that needs no network."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich import box
from rich.table import Table as TextTable

from ground.rendered import Rendered
from ground.report import charts, page, tables
from ground.report.figures import Curve, Figure, Panel
from ground.sweep import run
from ground.terminal import heading, literal, render
from mavlink_io.errors import InputError
from mavlink_io.user_data_dir import write_output
from sysid.sweep import parts, statistics
from sysid.sweep.statistics import CellSummary, Distribution, Influence, Table

N_WORST, N_WORST_TEXT = 20, 5
"""Number of worst dives on the page and in the text."""
CURVE_POINTS = 200
"""Number of points of a distribution curve."""
TITLES = {
    "heading_deg": ("heading error", "deg"),
    "pitch_deg": ("pitch error", "deg"),
    "depth_m": ("depth error", "m"),
    "settling_s": ("settling time", "s"),
}
RESULTS = {"passed": "passed", **{name: title for name, (title, _) in TITLES.items()}}
"""Results whose dependence on the inputs is shown."""
ROLES = ("initial", "redesigned", "set_point", "measured")
"""Colours of the sets of gains; a fifth set has the first colour again."""
FIGURE_PREFIX = "sweep-"
"""Beginning of the key of a figure; the name of its error follows."""
PAGE, CELLS = "report.html", "cells.csv"


class SweepReport(NamedTuple):
    """Evaluation of the dives that the folder of a sweep holds."""

    description: dict[str, Any]
    table: Table
    cells: list[CellSummary]
    influences: dict[str, list[Influence]]
    """By the results in `RESULTS`; those that do not vary are empty."""
    worst: list[dict[str, Any]]
    """Number, reason, errors and command of the worst dives, worst first."""


def write(folder: Path) -> SweepReport:
    """Evaluate a sweep, and write `report.html` and `cells.csv` into its folder.

    Parameters
    ----------
    folder : Path
        Folder of a sweep, which may be unfinished.

    Returns
    -------
    SweepReport
        The evaluation.

    Raises
    ------
    InputError
        The folder is not that of a sweep, or has no dives.
    """
    description = run.read_description(folder)
    table = statistics.read(parts.texts(folder))
    if not len(table):
        raise InputError(f"{folder}: has no dives; run `ground sweep` first")
    report = SweepReport(
        description=description,
        table=table,
        cells=statistics.cells(table, description["listed"]),
        influences={name: statistics.influences(table, name) for name in RESULTS},
        worst=_worst(table),
    )
    write_output(folder / CELLS, _csv(report.cells))
    write_output(folder / PAGE, _page(report))
    return report


def _worst(table: Table) -> list[dict[str, Any]]:
    """Return number, reason, errors and command of the worst dives."""
    reasons = statistics.failures(table)
    return [
        {
            "dive": int(table.numbers["dive"][row]),
            "reason": reasons[row],
            **{
                name: value if math.isfinite(value := float(table.numbers[name][row])) else None
                for name in TITLES
            },
            "command": str(table.texts["command"][row]),
        }
        for row in statistics.worst(table, N_WORST)
    ]


def _csv(cells: Sequence[CellSummary]) -> str:
    """Return a table as CSV with one row for each combination."""
    rows = [_cell_row(cell) for cell in cells]
    text = io.StringIO()
    lines = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    lines.writeheader()
    lines.writerows(rows)
    return text.getvalue()


def _cell_row(cell: CellSummary) -> dict[str, object]:
    """Return a combination as one flat row."""
    return {
        **cell.inputs,
        "dives": cell.dives,
        "passed": cell.passed,
        "probability": cell.probability.estimate,
        "low": cell.probability.low,
        "high": cell.probability.high,
        **{
            f"{name}_{quantile}": getattr(cell.errors[name], quantile)
            if name in cell.errors
            else ""
            for name in TITLES
            for quantile in Distribution._fields
        },
        "failures": "; ".join(f"{reason}: {count}" for reason, count in cell.failures.items()),
    }


def as_json(report: SweepReport) -> dict[str, Any]:
    """Return the evaluation as plain numbers.

    Parameters
    ----------
    report : SweepReport
        Evaluation.

    Returns
    -------
    dict
        Description of the sweep, its combinations, influences and worst dives.
    """
    return {
        "sweep": report.description,
        "dives": len(report.table),
        "cells": [
            {
                **cell.inputs,
                "dives": cell.dives,
                "passed": cell.passed,
                "probability": cell.probability._asdict(),
                "failures": cell.failures,
                **{name: values._asdict() for name, values in cell.errors.items()},
            }
            for cell in report.cells
        ],
        "influences": {
            result: [
                entry._asdict()
                | {"direction": None if math.isnan(entry.direction) else entry.direction}
                for entry in entries
            ]
            for result, entries in report.influences.items()
        },
        "worst": report.worst,
    }


def format_text(report: SweepReport, folder: Path) -> Rendered:
    """Return pass probabilities, influences and worst dives as text.

    Parameters
    ----------
    report : SweepReport
        Evaluation.
    folder : Path
        Folder of the sweep.

    Returns
    -------
    Rendered
        Text for the terminal.
    """
    names = _shown_inputs(report)
    probabilities = _text_table(*names, "dives", "passed", "probability", "95 % interval", "")
    for cell in report.cells:
        low, high = cell.probability.low, cell.probability.high
        probabilities.add_row(
            *(cell.inputs[name] for name in names),
            str(cell.dives),
            str(cell.passed),
            f"{cell.probability.estimate:.3f}",
            f"{low:.3f} to {high:.3f}",
            "; ".join(f"{count} {reason}" for reason, count in cell.failures.items()),
        )
    lines = [
        literal(f"{RESULTS[result]}: {_format_influences(entries[:5])}")
        for result, entries in report.influences.items()
        if entries
    ]
    worst = [literal(_format_worst(row)) for row in report.worst[:N_WORST_TEXT]]
    text = render(
        [
            heading(f"{report.description['plan']}: {_size(report)}"),
            probabilities,
            heading("which input matters: share of the variance of the ranks"),
            *lines,
            heading("worst dives"),
            *worst,
            literal(f"{folder / PAGE}, {folder / CELLS}"),
        ]
    )
    return Rendered("\n".join(line.rstrip() for line in text.split("\n") if line.strip()))


def _size(report: SweepReport) -> str:
    """Return how many dives of the sweep are evaluated."""
    planned, done = report.description["dives"], len(report.table)
    if done == planned:
        return f"{done} dives"
    return f"{done} dives of {planned}; the sweep is not finished"


def _shown_inputs(report: SweepReport) -> list[str]:
    """Return the inputs that differ between the combinations, or the gains."""
    names = list(report.cells[0].inputs)
    return [n for n in names if len({cell.inputs[n] for cell in report.cells}) > 1] or ["gains"]


def _format_influences(entries: Sequence[Influence]) -> str:
    """Return the influences in one line."""
    texts = [f"{entry.input} {100.0 * entry.share:.0f} %{_sign(entry)}" for entry in entries]
    return ", ".join(texts) or "no input"


def _sign(entry: Influence) -> str:
    """Return the direction of an influence as a sign."""
    if math.isnan(entry.direction):
        return ""
    return " (+)" if entry.direction > 0.0 else " (-)"


def _format_worst(row: Mapping[str, Any]) -> str:
    """Return one line about a dive."""
    errors = ", ".join(
        f"{title} {row[name]:.2f} {unit}"
        for name, (title, unit) in TITLES.items()
        if row[name] is not None
    )
    reason = f"{row['reason']}; " if row["reason"] else ""
    return f"{row['command']}: {reason}{errors}"


def _text_table(*heads: str) -> TextTable:
    """Return an empty table with these column titles."""
    table = TextTable(box=box.SIMPLE_HEAD, pad_edge=False)
    for head in heads:
        table.add_column(head, justify="left")
    return table


def _page(report: SweepReport) -> str:
    """Return the HTML of the report."""
    figures = _figures(report.table)
    parts_of_page = {
        "title": escape(f"Sweep {report.description['plan']}"),
        "lead": escape(_size(report)),
        "criterion": escape(_criterion(report.description["limits"])),
        "cells": _cells_table(report),
        "distributions": "".join(_distribution(report, figure) for figure in figures),
        "influences": _influences_table(report),
        "worst": _worst_table(report),
        "description": tables.table(
            ["", ""],
            [
                [escape(key), escape(_plain(value))]
                for key, value in report.description.items()
                if value not in (None, [], {})
            ],
            "named prose",
        ),
        "footer": escape(f"Digest of all rows: {report.description['digest'] or 'not finished'}."),
    }
    charts_by_id = {figure.key: charts.figure_chart(figure) for figure in figures}
    return page.render(parts_of_page, charts_by_id, files("ground.report") / "sweep.html")


def _plain(value: object) -> str:
    """Return a value of the description as text."""
    if isinstance(value, list):
        return ", ".join(map(str, value))
    if isinstance(value, dict):
        return ", ".join(f"{key} {entry}" for key, entry in value.items())
    return str(value)


def _criterion(limits: Mapping[str, float]) -> str:
    """Return when a dive passes."""
    others = [
        f"{title} at most {limits[name]:g} {unit}"
        for name, (title, unit) in TITLES.items()
        if name in limits
    ]
    text = "A dive passes if it is held to its end without broaching and without a failsafe"
    return f"{text}{', with ' if others else ''}{', '.join(others)}."


def _cells_table(report: SweepReport) -> str:
    """Return the pass probability of each combination."""
    names = _shown_inputs(report)
    rows = [
        [
            *(escape(cell.inputs[name]) for name in names),
            str(cell.dives),
            str(cell.passed),
            f"<b>{cell.probability.estimate:.3f}</b>",
            f"{cell.probability.low:.3f} – {cell.probability.high:.3f}",
            escape("; ".join(f"{count} {reason}" for reason, count in cell.failures.items())),
        ]
        for cell in report.cells
    ]
    heads = [*map(escape, names), "dives", "passed", "probability", "95 % interval", "not passed"]
    return tables.table(heads, rows, "named prose")


def _distribution(report: SweepReport, figure: Figure) -> str:
    """Return the figure of one error and its quantiles in each combination."""
    names, error = _shown_inputs(report), figure.key.removeprefix(FIGURE_PREFIX)
    rows = [
        [
            *(escape(cell.inputs[name]) for name in names),
            *(f"{value:.2f}" for value in cell.errors[error]),
        ]
        for cell in report.cells
        if error in cell.errors
    ]
    heads = [*map(escape, names), "5 %", "median", "95 %", "worst"]
    kind = "named" if len(names) > 1 else ""
    return page.place_figure(figure) + tables.table(heads, rows, kind)


def _influences_table(report: SweepReport) -> str:
    """Return the influences, one row for each result."""
    rows = [
        [
            title,
            "; ".join(
                f"{escape(entry.input)} {100.0 * entry.share:.0f} %{_sign(entry)}"
                for entry in report.influences[result][:8]
            )
            or "no input",
        ]
        for result, title in RESULTS.items()
    ]
    return tables.table(["", "inputs"], rows, "named prose")


def _worst_table(report: SweepReport) -> str:
    """Return the worst dives."""
    rows = []
    for row in report.worst:
        errors = ["–" if row[name] is None else f"{row[name]:.2f}" for name in TITLES]
        command = f"<code>{escape(row['command'])}</code>"
        rows.append([command, escape(row["reason"]), *errors])
    heads = ["command", "", *(f"{title}, {unit}" for title, unit in TITLES.values())]
    return tables.table(heads, rows, "named")


def _figures(table: Table) -> list[Figure]:
    """Return the cumulative distribution of each error, one curve for each set of gains."""
    gains = list(dict.fromkeys(table.texts["gains"].tolist()))
    figures = []
    for name, (title, unit) in TITLES.items():
        curves = []
        for number, one in enumerate(gains):
            values = table.numbers[name][table.texts["gains"] == one]
            values = np.sort(values[np.isfinite(values)])
            if values.size:
                share = np.linspace(0.0, 1.0, min(CURVE_POINTS, values.size))
                x = np.quantile(values, share)
                curves.append(Curve(one, ROLES[number % len(ROLES)], x, 100.0 * share))
        if curves:
            panel = Panel("share of the dives", "%", tuple(curves), (0.0, 100.0))
            note = "Dives with at most this value, over all vehicles, missions and seas."
            figures.append(
                Figure(
                    f"{FIGURE_PREFIX}{name}", title.capitalize(), note, f"{title}, {unit}", (panel,)
                )
            )
    return figures
