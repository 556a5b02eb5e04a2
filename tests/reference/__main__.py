"""Print all check-cases with reference and tolerance: ``python -m tests.reference [--json]``.

The exit status is 1 if a value is outside its tolerance.
"""

from __future__ import annotations

import json
import sys
from typing import NamedTuple

from rich.console import Console
from rich.progress import track
from rich.table import Table

from tests.reference.cases import CASES
from tests.reference.check import Check, run, title

PLAIN_WIDTH = 190
"""Width of the table in columns without a terminal."""


class Row(NamedTuple):
    """One line of the table."""

    case: str
    check: Check


def main() -> int:
    """Run and print all cases; return 0 if all pass, else 1."""
    as_json = "--json" in sys.argv[1:]
    progress = Console(stderr=True)
    rows = [
        Row(title(case), check)
        for case in track(
            CASES, "check-cases", console=progress, transient=True, disable=not progress.is_terminal
        )
        for check in run(case)
    ]
    print(json.dumps(_document(rows), indent=1)) if as_json else _print(rows)
    return 0 if all(row.check.passed for row in rows) else 1


def _document(rows: list[Row]) -> dict[str, object]:
    return {
        "passed": all(row.check.passed for row in rows),
        "checks": [
            {"case": row.case, **row.check._asdict(), "passed": row.check.passed} for row in rows
        ],
    }


def _print(rows: list[Row]) -> None:
    console = Console()
    if not console.is_terminal:
        console = Console(width=PLAIN_WIDTH)
    table = Table(box=None, pad_edge=False)
    for name in ("case", "quantity"):
        table.add_column(name)
    for name in ("value", "reference", "tolerance"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("unit", "", "reference from"):
        table.add_column(name)
    before = ""
    for case, check in rows:
        figures = (_figure(check.value), _figure(check.reference), f"{check.tolerance:.2g}")
        verdict = "pass" if check.passed else "[bold red]MISS[/]"
        table.add_row(
            "" if case == before else case,
            check.quantity,
            *figures,
            check.unit,
            verdict,
            check.source,
        )
        before = case
    console.print(table)
    missed = sum(not row.check.passed for row in rows)
    console.print(f"\n{len(rows)} figures of {len(CASES)} check-cases, {missed} outside tolerance")


def _figure(value: float) -> str:
    """Return a number with seven digits, or as a power of ten below 0.001."""
    return "0" if value == 0.0 else f"{value:.7g}" if abs(value) >= 1e-3 else f"{value:.2e}"


if __name__ == "__main__":
    sys.exit(main())
