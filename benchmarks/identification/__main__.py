"""The Monte-Carlo study of identification.

    python -m benchmarks.identification outside          plants from outside: the headline
    python -m benchmarks.identification [CELL ...] [--vehicle NAME ...] [--runs N] [--out FILE.json]

In all cells but `outside` the true vehicle has the estimator's own physics.

Each figure is printed with its target. The exit status is 1 if a figure misses its target.
"""

import argparse
import sys

from benchmarks import study
from benchmarks.identification import vehicles
from benchmarks.identification.cells import CELLS, cases_of
from benchmarks.identification.outside import PRIORS


def main() -> None:
    """Run the chosen cells; exit with status 1 if a figure misses its target."""
    asked = _arguments()
    questions = [
        (CELLS[name], case)
        for name in asked.cell or CELLS
        for case in cases_of(CELLS[name])
        if not asked.vehicle or case in asked.vehicle
    ]
    sys.exit(study.exit_status(study.run_cells(questions, asked)))


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = study.parser(__doc__, "campaigns per cell; default 200 for most cells")
    parser.add_argument("cell", nargs="*", choices=[[], *CELLS], help="cells to run; default all")
    parser.add_argument(
        "--vehicle",
        action="append",
        choices=[*(case.name for case in vehicles.cases()), *PRIORS],
        help="vehicle, or plant of the cell outside; default all",
    )
    return parser.parse_args()


if __name__ == "__main__":
    main()
