"""Soak: the rows of robustness as one table, sized, resumable.

    python -m tests.soak [--size FRACTION] [--rows NAME,...] [--folder FOLDER] [--fresh]

Each row runs numbered cases up to a fraction of the size that is required, and keeps its counts in
FOLDER after each batch: an interrupted or a larger run continues there. A failed case is repeated
by its number. Exit status 1 if a row does not hold.
"""

import argparse
import sys
from pathlib import Path

from tests.soak import files, flips, flood, frames, kills, protocols
from tests.soak.row import Result, Row

ROWS: dict[str, Row] = {
    "frames": frames.ROW,
    "files": files.ROW,
    "flips": flips.ROW,
    "kills": kills.ROW,
    "flood": flood.ROW,
    "protocols": protocols.ROW,
}
"""Rows by name. A new row is a module with a ``ROW``, and one line here."""
DEFAULT_SIZE = 0.01


def main() -> int:
    """Run the rows and print the table; return the exit status."""
    asked = _arguments()
    failed = False
    for name in asked.rows:
        row, path = ROWS[name], asked.folder / f"{name}.json"
        if asked.fresh:
            path.unlink(missing_ok=True)
        result = Result(path)
        result.extend(row, max(1, round(asked.size * row.full_size)))
        holds = row.holds(result.batch.counts)
        failed |= not holds
        hours = result.seconds / max(1, result.cases) * row.full_size / 3600.0
        print(f"{'ok  ' if holds else 'FAIL'} {row.title}: {row.describe(result.batch.counts)}")
        print(f"     required: {row.requirement}")
        print(
            f"     {result.cases} of {row.full_size} cases in {result.seconds:.0f} s;"
            f" all would take {hours:.1f} h",
            flush=True,
        )
        for text in result.batch.failures:
            print(f"     {text[:300]}")
    return int(failed)


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
    return parser.parse_args()


def _rows(text: str) -> list[str]:
    """Return the names of rows in a text."""
    names = text.split(",")
    if unknown := sorted(set(names) - set(ROWS)):
        raise argparse.ArgumentTypeError(f"{unknown[0]}: no row; give some of {', '.join(ROWS)}")
    return names


if __name__ == "__main__":
    sys.exit(main())
