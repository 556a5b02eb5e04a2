"""Speed of every part, each figure beside a floor or a peer that is measured in the same run.

    python -m benchmarks [--busy] [--rows NAME,...] [--repetitions N] [--json FILE]

Prints a table and keeps the figures as JSON. `python -m benchmarks.page` writes
`docs/performance.md` from both files, idle and busy.
"""

import argparse
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from benchmarks.page import RESULTS
from benchmarks.speed import machine, results
from benchmarks.speed.measures import MEASURES
from benchmarks.speed.results import Measurement, Results
from benchmarks.speed.rows import ROWS, Mode
from benchmarks.speed.session import Measure, Session
from mavlink_io.errors import CaribouError, InputError, exit_with_error

PROGRAM = "python -m benchmarks"


def main() -> None:
    """Measure the chosen rows, print the table and keep the figures."""
    asked = _arguments()
    try:
        run(asked)
    except (CaribouError, OSError) as error:
        exit_with_error(PROGRAM, error)
    except KeyboardInterrupt:
        sys.exit(f"{PROGRAM}: interrupted; the rows that were finished are kept")


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(PROGRAM, description=__doc__, formatter_class=raw)
    parser.add_argument(
        "--busy", action="store_true", help="load each core with another process meanwhile"
    )
    parser.add_argument(
        "--rows", type=_rows, default=list(ROWS), metavar="NAME,...", help=", ".join(ROWS)
    )
    parser.add_argument(
        "--repetitions", type=_count, help="of every figure; default 1 to 9, depending on the row"
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="default docs/performance/idle.json, busy.json"
    )
    parser.add_argument(
        "--peer", type=Path, metavar="FOLDER", help="checkout of PythonVehicleSimulator"
    )
    asked = parser.parse_args()
    if asked.peer and not (asked.peer / "src").is_dir():
        parser.error(f"--peer {asked.peer}: has no folder src; give a checkout")
    return asked


def _rows(text: str) -> list[str]:
    """Return the names of rows. Raises ArgumentTypeError."""
    names = text.split(",")
    for name in names:
        if name not in ROWS:
            raise argparse.ArgumentTypeError(f"{name!r} is no row; rows: {', '.join(ROWS)}")
    return names


def _count(text: str) -> int:
    """Return a number of repetitions. Raises ArgumentTypeError."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of 1 or more")
    return int(text)


def run(asked: argparse.Namespace) -> None:
    """Measure the chosen rows. Raises InputError, OSError."""
    mode = Mode.BUSY if asked.busy else Mode.IDLE
    path = asked.json or RESULTS / f"{mode}.json"
    known = known_results(path, mode, whole=set(asked.rows) == set(ROWS))
    results.write(known, path)  # a file that cannot be written is reported before the work
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(machine.busy_loops(known.machine.cores if asked.busy else 0))
        session = Session(folder, asked.repetitions, asked.peer)
        for names, measure in MEASURES.items():
            chosen = tuple(name for name in names if name in asked.rows)
            if chosen:
                known = results.merge(known, _measure(session, chosen, measure, known))
                results.write(known, path)
    figures = [figure for figure in known.figures if figure.row in asked.rows]
    sys.stdout.write(f"{mode}; {known.machine.cores} cores, {known.machine.cpu}\n")
    sys.stdout.write(results.as_table(figures) + f"\n{path}\n")


def known_results(path: Path, mode: Mode, *, whole: bool) -> Results:
    """Return the results of earlier runs on this machine; none yet if there is no file.

    Raises InputError if only some rows are measured and the file is of another machine or mode.
    """
    new = Results(mode, machine.describe(), ())
    if not path.exists():
        return new
    known = results.read(path)
    if (known.mode, known.machine) == (mode, new.machine):
        return known
    if whole:
        return new
    raise InputError(
        f"{path}: was measured with another machine, version or mode; measure all rows, or give"
        " another --json"
    )


def _measure(session: Session, names: tuple[str, ...], measure: Measure, known: Results) -> Results:
    """Return the figures of one group of rows; a failure is noted in its rows."""
    session.report(f"-- {', '.join(names)}")
    watch = machine.Watch()
    try:
        measured = [each for each in measure(session) if each.row in names]
    except CaribouError as error:
        session.report(f"not measured: {error}")
        measured = [Measurement(name, (), note=f"not measured: {error}") for name in names]
    conditions = watch.conditions()
    figures = tuple(results.to_figure(each, known.mode, conditions) for each in measured)
    return Results(known.mode, known.machine, figures)


if __name__ == "__main__":
    main()
