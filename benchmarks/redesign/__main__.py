"""The Monte-Carlo study of redesigned gains in the water.

    python -m benchmarks.redesign [CELL ...] [--case NAME ...] [--runs N] [--model FILE.json] [--out
    FILE.json]

Without a model it flies a campaign first. Each figure is printed beside its target; a missed one is
marked, and makes the exit status 1."""

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
    asked = _arguments()
    with campaign.refusals():
        sys.exit(study.status(study.ask(_questions(asked), asked)))


def _arguments() -> argparse.Namespace:
    cases = sorted({case for question in QUESTIONS.values() for case in question.cases})
    parser = study.parser(__doc__, "of each case; 20 for most")
    parser.add_argument(
        "cell", nargs="*", choices=[[], *QUESTIONS], help="which cells; all without one"
    )
    parser.add_argument(
        "--case", action="append", choices=cases, metavar="NAME", help=", ".join(cases)
    )
    parser.add_argument(
        "--model", type=Path, help="redesign from this model.json instead of a campaign's"
    )
    return parser.parse_args()


def _questions(asked: argparse.Namespace) -> Iterator[tuple[Cell, str]]:
    gains = cache(lambda: _gains(asked.model, asked.seed))
    for question in [QUESTIONS[name] for name in asked.cell or QUESTIONS]:
        cell = question.cell(gains)
        yield from ((cell, case) for case in question.cases if not asked.case or case in asked.case)


def _gains(model: Path | None, seed: int) -> dict[str, Values]:
    """The sets of gains to compare. Raises ModelError, DesignRefused."""
    flown = campaign.known(model, seed)
    return campaign.gain_sets(flown.trims, campaign.redesigned(flown).gains)


if __name__ == "__main__":
    main()
