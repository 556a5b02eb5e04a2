"""The Monte-Carlo study of identification.

    python -m benchmarks.identification [CELL ...] [--vehicle NAME ...] [--runs N] [--out FILE.json]

Each figure is printed beside its target; a missed one is marked, and makes the exit status 1.
"""

import argparse
import json
import math
import os
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.identification import study, vehicles
from benchmarks.identification.cells import CELLS
from benchmarks.identification.study import Figure, Outcome

COLUMNS = ("cell", "vehicle", "figure", "value", "target", "")


def main() -> None:
    asked = _arguments()
    names = asked.vehicle or [case.name for case in vehicles.cases()]
    outcomes = []
    for cell in [CELLS[name] for name in asked.cell or CELLS]:
        for vehicle in names:
            outcomes.append(study.run(cell, vehicle, asked.runs or cell.runs, asked.seed, asked.jobs))
            _show(outcomes[-1])
            if asked.out:
                asked.out.write_text(_text(outcomes, asked.seed), encoding="utf-8")
    sys.exit(0 if all(figure.met for outcome in outcomes for figure in outcome.figures) else 1)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cell", nargs="*", choices=[[], *CELLS], help="which cells; all without one")
    parser.add_argument("--vehicle", action="append", choices=[case.name for case in vehicles.cases()])
    parser.add_argument("--runs", type=int, help="campaigns a cell; 200 for most")
    parser.add_argument("--seed", type=int, default=1, help="of the first campaign")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="JSON of all figures")
    return parser.parse_args()


def _show(outcome: Outcome) -> None:
    table = Table(*COLUMNS, box=None, show_header=False, padding=(0, 2, 0, 0))
    for figure in outcome.figures:
        mark = "" if not _target(figure) else "met" if figure.met else "MISSED"
        value = f"{figure.value:.4g} {figure.unit}".strip()
        table.add_row(outcome.cell, f"{outcome.vehicle} x {outcome.runs}", figure.name, value, _target(figure), mark)
    Console(width=160).print(table)


def _target(figure: Figure) -> str:
    if math.isinf(figure.lowest):
        return "" if math.isinf(figure.highest) else f"<= {figure.highest:g}"
    return f">= {figure.lowest:g}" if math.isinf(figure.highest) else f"{figure.lowest:g} to {figure.highest:g}"


def _text(outcomes: list[Outcome], seed: int) -> str:
    rows = [
        {"cell": o.cell, "vehicle": o.vehicle, "runs": o.runs, "seed": seed, "figure": f.name, "value": f.value,
         "unit": f.unit, "target": _target(f), "met": f.met}
        for o in outcomes
        for f in o.figures
    ]  # fmt: skip
    return json.dumps(rows, indent=1) + "\n"


if __name__ == "__main__":
    main()
