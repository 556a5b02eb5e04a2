"""The Monte-Carlo study of identification.

    python -m benchmarks.identification [CELL ...] [--vehicle NAME ...] [--runs N] [--out FILE.json]

Each figure is printed with its target. The exit status is 1 if a figure misses its target.
"""

import argparse
import sys

from benchmarks import study
from benchmarks.identification import vehicles
from benchmarks.identification.cells import CELLS


def main() -> None:
    """Run the chosen cells; exit with status 1 if a figure misses its target."""
    asked = _arguments()
    names = asked.vehicle or [case.name for case in vehicles.cases()]
    questions = [(CELLS[cell], vehicle) for cell in asked.cell or CELLS for vehicle in names]
    sys.exit(study.exit_status(study.run_cells(questions, asked)))


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = study.parser(__doc__, "campaigns per cell; default 200 for most cells")
    parser.add_argument("cell", nargs="*", choices=[[], *CELLS], help="cells to run; default all")
    parser.add_argument(
        "--vehicle", action="append", choices=[case.name for case in vehicles.cases()]
    )
    return parser.parse_args()


if __name__ == "__main__":
    main()
