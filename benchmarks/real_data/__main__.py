"""Estimators and readers on public free-running tests and logs.

    python -m benchmarks.real_data [--simman DIR] [--logs DIR ...] [--out FILE.json]

``--simman`` is a checkout of martinlarsalbert/System-identification-of-Vessel-Manoeuvring-Models;
``--logs`` are checkouts with logs, such as clydemcqueen/ardusub_log_tools and PX4/pyulog. No file
of them is copied here. `pip install nfoursid` adds the subspace method. Exit status 1 if a linear
method of this project predicts worse than the Nomoto model.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.real_data import public_logs, ship_tests
from benchmarks.real_data.public_logs import LogFinding
from benchmarks.real_data.ship_tests import ModelError

HSVA = Path("data") / "01_raw" / "kvlcc2_hsva" / "raw_data"
OWN_METHODS = ("output error", "filter error")


def main() -> int:
    """Print the tables; return the exit status."""
    asked = _arguments()
    errors, findings = [], []
    if asked.simman:
        with tempfile.TemporaryDirectory() as folder:
            errors = ship_tests.compare(ship_tests.read_tests(asked.simman / HSVA, Path(folder)))
        Console().print(_error_table(errors))
    for folder in asked.logs:
        findings += public_logs.examine(folder)
    if findings:
        Console().print(_log_table(findings))
    if asked.out:
        results = {
            "ship_tests": [error._asdict() for error in errors],
            "logs": [finding._asdict() for finding in findings],
        }
        asked.out.write_text(json.dumps(results, indent=1), encoding="utf-8")
    return 0 if not errors or all(_is_met(error, errors[0]) for error in errors) else 1


def _arguments() -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.real_data",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--simman", type=_folder, help="checkout with the KVLCC2 tests")
    parser.add_argument("--logs", type=_folder, action="append", default=[], help="repeatable")
    parser.add_argument("--out", type=Path, help="JSON of the results")
    asked = parser.parse_args()
    if not asked.simman and not asked.logs:
        parser.error("give --simman or --logs")
    return asked


def _folder(text: str) -> Path:
    """Return an existing folder. Raises ArgumentTypeError."""
    path = Path(text)
    if not path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no such folder; give a checkout")
    return path


def _is_met(error: ModelError, nomoto: ModelError) -> bool:
    """Return whether a method of this project is no worse than the Nomoto model."""
    return error.name not in OWN_METHODS or error.held_out <= nomoto.held_out


def _error_table(errors: Sequence[ModelError]) -> Table:
    """Return the errors of the models."""
    table = Table("KVLCC2, HSVA zig-zags", "fitted", "held out, (deg/s)²", "", box=box.SIMPLE_HEAD)
    for error in errors:
        note = error.note or ("" if _is_met(error, errors[0]) else "worse than Nomoto")
        table.add_row(error.name, f"{error.fitted:.4f}", f"{error.held_out:.4f}", note)
    return table


def _log_table(findings: Sequence[LogFinding]) -> Table:
    """Return what the logs hold."""
    table = Table("log", "segments", "velocity", "result", box=box.SIMPLE_HEAD)
    for finding in findings:
        table.add_row(finding.name, str(finding.segments), finding.velocity, finding.result)
    return table


if __name__ == "__main__":
    sys.exit(main())
