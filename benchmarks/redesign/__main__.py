"""The Monte-Carlo study of redesigned gains in simulated dives.

    python -m benchmarks.redesign [CELL ...] [--case NAME ...] [--runs N] [--model FILE.json] [--out
    FILE.json]

Without a model a campaign is simulated first. Each figure is printed with its target. The exit
status is 1 if a figure misses its target.
"""

import argparse
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from benchmarks import study
from benchmarks.redesign import campaign
from benchmarks.redesign.campaign import Values
from benchmarks.redesign.cells import QUESTIONS
from benchmarks.study import Cell


def main() -> None:
    """Run the chosen comparisons; exit with status 1 if a figure misses its target."""
    asked = _arguments()
    with campaign.exit_on_error():
        sys.exit(study.exit_status(study.run_cells(_questions(asked), asked)))


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    cases = sorted({case for question in QUESTIONS.values() for case in question.cases})
    parser = study.parser(__doc__, "runs per case; default 20 for most cells")
    parser.add_argument(
        "cell", nargs="*", choices=[[], *QUESTIONS], help="cells to run; default all"
    )
    parser.add_argument(
        "--case", action="append", choices=cases, metavar="NAME", help=", ".join(cases)
    )
    parser.add_argument(
        "--model", type=Path, help="model.json to redesign from, instead of a new campaign's"
    )
    return parser.parse_args()


def _questions(asked: argparse.Namespace) -> Iterator[tuple[Cell, str]]:
    """Yield each chosen cell with each chosen case; the gains are designed once."""
    gains = cache(lambda: _gains(asked.model, asked.seed))
    for question in [QUESTIONS[name] for name in asked.cell or QUESTIONS]:
        cell = question.cell(gains)
        yield from ((cell, case) for case in question.cases if not asked.case or case in asked.case)


def _gains(model: Path | None, seed: int) -> dict[str, Values]:
    """Return the sets of gains to compare.

    Raises ModelError, DesignInfeasibleError.
    """
    flown = campaign.load_or_fly(model, seed)
    return campaign.gain_sets(flown.trims, campaign.redesigned(flown).gains)


if __name__ == "__main__":
    main()
