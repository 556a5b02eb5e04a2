"""PID redesign and LQG of the same specification, on one model and on the same seeds.

    python -m benchmarks.advanced [CASE ...] [--model FILE.json] [--runs N] [--out FILE.json]

Without a model a campaign is simulated first. The exit status is 1 if no controller meets the
specification.
"""

import argparse
from pathlib import Path

from benchmarks import study
from benchmarks.advanced import designed, flown
from benchmarks.redesign import campaign
from benchmarks.study import Outcome


def main() -> None:
    """Compare the PID redesign and the LQG on one model."""
    asked = _arguments()
    with campaign.exit_on_error():
        model, trims = campaign.load_or_fly(asked.model, asked.seed)
        both = designed.designed(model, trims)
    promised = Outcome("advanced", "predicted", 1, tuple(designed.promised(model, both)))
    cell = flown.cell(both.contenders)
    study.run_cells([(cell, case) for case in asked.case or flown.CASES], asked, known=[promised])


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = study.parser(__doc__, "dives per case; default 20")
    parser.add_argument(
        "case",
        nargs="*",
        choices=[[], *flown.CASES],
        help="seas or vehicles; default all",
    )
    parser.add_argument("--model", type=Path, help="model.json to use instead of a new campaign's")
    return parser.parse_args()


if __name__ == "__main__":
    main()
