"""The Monte-Carlo study of identification.

    python -m benchmarks.identification [CELL ...] [--vehicle NAME ...] [--runs N] [--out FILE.json]

Each figure is printed beside its target; a missed one is marked, and makes the exit status 1.
"""

import argparse
import sys

from benchmarks import study
from benchmarks.identification import vehicles
from benchmarks.identification.cells import CELLS


def main() -> None:
    asked = _arguments()
    names = asked.vehicle or [case.name for case in vehicles.cases()]
    questions = [(CELLS[cell], vehicle) for cell in asked.cell or CELLS for vehicle in names]
    sys.exit(study.status(study.ask(questions, asked)))


def _arguments() -> argparse.Namespace:
    parser = study.parser(__doc__, "campaigns a cell; 200 for most")
    parser.add_argument(
        "cell", nargs="*", choices=[[], *CELLS], help="which cells; all without one"
    )
    parser.add_argument(
        "--vehicle", action="append", choices=[case.name for case in vehicles.cases()]
    )
    return parser.parse_args()


if __name__ == "__main__":
    main()
