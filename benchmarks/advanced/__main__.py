"""PID redesign and LQG of the same specification, on one model and on the same seeds.

    python -m benchmarks.advanced [CASE ...] [--model FILE.json] [--runs N] [--out FILE.json]

Without a model it flies a campaign first. Exit status 1 where no gains or laws meet the
specification."""

import argparse
from pathlib import Path

from benchmarks import study
from benchmarks.advanced import designed, flown
from benchmarks.redesign import campaign
from benchmarks.study import Outcome


def main() -> None:
    asked = _arguments()
    with campaign.refusals():
        model, trims = campaign.known(asked.model, asked.seed)
        both = designed.designed(model, trims)
    promised = Outcome("advanced", "predicted", 1, tuple(designed.promised(model, both)))
    cell = flown.cell(both.contenders)
    study.ask([(cell, case) for case in asked.case or flown.CASES], asked, known=[promised])


def _arguments() -> argparse.Namespace:
    parser = study.parser(__doc__, "dives of each case; 20 unless told")
    parser.add_argument(
        "case",
        nargs="*",
        choices=[[], *flown.CASES],
        help="which seas or vehicles; all without one",
    )
    parser.add_argument("--model", type=Path, help="a model.json instead of a campaign's")
    return parser.parse_args()


if __name__ == "__main__":
    main()
