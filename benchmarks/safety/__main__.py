"""Fly one dive of the safety rows of `make soak` alone, and print its outcome.

    python -m benchmarks.safety NAME [--vehicle VEHICLE] [--seed N] [--oracle]

NAME is fault:UNIT-KIND, pair:N, mission:N or parameter:NAME=VALUE. The oracle is flown where the
vehicle touches the floor, and with --oracle always.
"""

import argparse
import os

# As in the ``ground`` command, before numpy is imported: one thread of linear algebra.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.safety import cases, flight
from mavlink_io.errors import CaribouError, exit_with_error

PROGRAM = "python -m benchmarks.safety"


def main() -> None:
    """Fly the dive that the command line names."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(PROGRAM, description=__doc__, formatter_class=raw)
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("--vehicle", default=cases.VEHICLES[0], choices=cases.VEHICLES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--oracle", action="store_true", help="fly the oracle too")
    asked = parser.parse_args()
    try:
        case = cases.find_case(asked.name, asked.vehicle, asked.seed)
        for key, value in case._asdict().items():
            print(f"{key:13s} {value}")
        outcome = flight.fly(case)
        for key, value in outcome._asdict().items():
            print(f"{key:13s} {value}")
        print(f"{'failure':13s} {outcome.failure or 'none'}")
        if asked.oracle:
            print(f"oracle touches the floor at {flight.oracle_contact_s(case):.1f} s")
    except CaribouError as error:
        exit_with_error(PROGRAM, error)


if __name__ == "__main__":
    main()
