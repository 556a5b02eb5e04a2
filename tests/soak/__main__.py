"""Soak: the rows of robustness as one table, sized, resumable.

    python -m tests.soak [--size FRACTION] [--rows NAME,...] [--folder FOLDER] [--minutes N]

Each row runs numbered cases up to a fraction of the size that is required, and keeps its counts in
FOLDER after each batch: an interrupted or a larger run continues there. --size 0 prints the table
of what is kept. A failed case is repeated by its number or the command that is printed. Exit status
1 if a row does not hold.
"""

import argparse
import math
import os
import sys
import time
from pathlib import Path

# As in the ``ground`` command, before numpy is imported: one thread of linear algebra.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.safety import flight
from tests.soak import dives, endurance, files, flips, flood, frames, kills, protocols
from tests.soak.row import Result, Row

ROWS: dict[str, Row] = {
    "faults": dives.FAULTS,
    "pairs": dives.PAIRS,
    "deflection": dives.DEFLECTION,
    "frames": frames.ROW,
    "files": files.ROW,
    "flips": flips.ROW,
    "kills": kills.ROW,
    "flood": flood.ROW,
    "parameters": dives.PARAMETERS,
    "missions": dives.MISSIONS,
    "endurance": endurance.ROW,
    "protocols": protocols.ROW,
}
"""Rows by name. A new row is a module with a ``ROW``, and one line here."""
DIVES = {"faults", "pairs", "deflection", "parameters", "missions"}
"""Rows of simulated dives."""
DEFAULT_SIZE = 0.01
WIDTH = 150
"""Width of the table where the output is no terminal."""


def main() -> int:
    """Run the rows and print the table; return the exit status."""
    asked = _arguments()
    stop_s = time.monotonic() + 60.0 * asked.minutes
    results = {}
    if asked.size and DIVES & set(asked.rows):
        flight.compile_ticks()
    for name in asked.rows:
        row, path = ROWS[name], asked.folder / f"{name}.json"
        if asked.fresh:
            path.unlink(missing_ok=True)
        results[name] = result = Result(path)
        size = max(1, round(asked.size * row.full_size)) if asked.size else 0
        print(f"{name}: {result.cases} of {row.full_size} cases before", file=sys.stderr)
        result.extend(row, size, stop_s)
    _print_table(results)
    return int(any(not _holds(ROWS[name], result) for name, result in results.items()))


def _holds(row: Row, result: Result) -> bool:
    """Return whether the cases so far hold; a row without a case does not."""
    return result.cases > 0 and row.holds(result.batch.counts)


def _print_table(results: dict[str, Result]) -> None:
    """Print one line for each row, and its failures and details below the table."""
    table = Table(box=box.MARKDOWN)
    for column in ("row", "cases", "", "required", "result"):
        table.add_column(column)
    for name, result in results.items():
        row = ROWS[name]
        table.add_row(
            f"{name}: {row.title}",
            f"{result.cases} of {row.full_size} in {result.seconds / 60.0:.1f} min",
            "ok" if _holds(row, result) else "FAIL" if result.cases else "-",
            row.requirement,
            row.describe(result.batch.counts) if result.cases else "",
        )
    console = Console(width=None if sys.stdout.isatty() else WIDTH, markup=False, highlight=False)
    console.print(table)
    for name, result in results.items():
        lines = [*result.batch.failures, *ROWS[name].details(result.batch.counts)]
        for text in lines:
            print(f"{name}: {text[:300]}")


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        "python -m tests.soak", description=__doc__, formatter_class=raw
    )
    parser.add_argument("--size", type=float, default=DEFAULT_SIZE, metavar="FRACTION")
    parser.add_argument("--rows", type=_rows, default=list(ROWS), metavar="NAME,...")
    parser.add_argument("--folder", type=Path, default=Path("build/soak"), metavar="FOLDER")
    parser.add_argument("--fresh", action="store_true", help="forget what is in FOLDER")
    parser.add_argument(
        "--minutes",
        type=float,
        default=math.inf,
        metavar="N",
        help="begin no batch of cases after this time; a later run continues",
    )
    return parser.parse_args()


def _rows(text: str) -> list[str]:
    """Return the names of rows in a text."""
    names = text.split(",")
    if unknown := sorted(set(names) - set(ROWS)):
        raise argparse.ArgumentTypeError(f"{unknown[0]}: no row; give some of {', '.join(ROWS)}")
    return names


if __name__ == "__main__":
    sys.exit(main())
