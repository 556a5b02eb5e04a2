"""The Monte-Carlo study of identification.

    python -m benchmarks.identification [CELL ...] [--vehicle NAME ...] [--runs N] [--out FILE.json]

Each figure is printed beside its target; a missed one is marked, and makes the exit status 1.
"""

import argparse
import os
import sys
from pathlib import Path

from benchmarks import study
from benchmarks.identification import vehicles
from benchmarks.identification.cells import CELLS


def main() -> None:
    asked = _arguments()
    names = asked.vehicle or [case.name for case in vehicles.cases()]
    outcomes = []
    for cell in [CELLS[name] for name in asked.cell or CELLS]:
        for vehicle in names:
            outcomes.append(study.run(cell, vehicle, asked.runs or cell.runs, asked.seed, asked.jobs))
            study.show(outcomes[-1])
            if asked.out:
                asked.out.write_text(study.as_json(outcomes, asked.seed), encoding="utf-8")
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


if __name__ == "__main__":
    main()
