"""Safety of the closed loop against faults, bad parameters and random missions.

    python -m benchmarks.safety [PART ...] [--seeds N] [--pairs N] [--missions N] [--keep FOLDER]
    python -m benchmarks.safety --dive NAME --vehicle VEHICLE --seed N [--oracle]

Parts are faults, pairs, parameters and missions. Dives that are finished are kept and not flown
again. For each dive that fails, the second form is printed: it flies that dive alone.
"""

import argparse
import os
from pathlib import Path

# As in the ``ground`` command, before numpy is imported: one thread of linear algebra.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.safety import cases, flight, study
from mavlink_io.errors import CaribouError, exit_with_error

PROGRAM = "python -m benchmarks.safety"


def main() -> None:
    """Fly the parts that the command line names, or one dive."""
    asked = _arguments()
    try:
        if asked.dive:
            case = study.find_case(asked.dive, asked.vehicle, asked.seed)
            print(case)
            for key, value in flight.fly(case)._asdict().items():
                print(f"{key:10s} {value}")
            if asked.oracle:
                print(f"oracle touches the floor at {flight.oracle_contact_s(case):.1f} s")
            return
        sizes = study.Sizes(
            seeds=asked.seeds,
            pairs=asked.pairs,
            missions=asked.missions,
            vehicles=tuple(asked.vehicles),
        )
        asked.keep.mkdir(parents=True, exist_ok=True)
        for part in asked.parts or study.PARTS:
            print(study.report(part, sizes, asked.keep, jobs=asked.jobs), flush=True)
    except (CaribouError, OSError) as error:
        exit_with_error(PROGRAM, error)


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(PROGRAM, description=__doc__, formatter_class=raw)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(study.PARTS))
    parser.add_argument("--seeds", type=int, default=20, help="of the catalogue of faults")
    parser.add_argument("--pairs", type=int, default=2000)
    parser.add_argument("--missions", type=int, default=1000)
    parser.add_argument("--vehicles", nargs="+", default=cases.VEHICLES, choices=cases.VEHICLES)
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    parser.add_argument(
        "--keep", type=Path, default=Path("studies/safety"), help="folder of the finished dives"
    )
    parser.add_argument("--dive", metavar="NAME", help="name of one dive, as printed")
    parser.add_argument("--vehicle", default=cases.VEHICLES[0], choices=cases.VEHICLES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--oracle", action="store_true", help="fly the oracle too")
    asked = parser.parse_args()
    if wrong := set(asked.parts) - set(study.PARTS):
        parser.error(f"part {sorted(wrong)[0]!r}: expected {', '.join(study.PARTS)}")
    return asked


if __name__ == "__main__":
    main()
