"""The paper's Tables 1 to 5 and the derivation of Table 1's initial column, without flying."""

import subprocess
import sys
from typing import Any

from ground.errors import OperationError
from ground.report import paper_poles
from ground.report.paper_poles import PolesComparison


def collect(poles: PolesComparison) -> dict[str, Any]:
    """The printed tables, Table 4 as reckoned, and the first-principles derivation as text.

    Raises:
        FailedError: the derivation did not run.
    """
    from sysid.reproduction import paper_tables

    initial, adjusted = (
        paper_tables.TABLE_1_INITIAL._asdict(),
        paper_tables.TABLE_1_ADJUSTED._asdict(),
    )
    return {
        "table_1": {n: {"initial": initial[n], "adjusted": adjusted[n]} for n in initial},
        "table_2_deg2ps2": {name: row._asdict() for name, row in paper_tables.TABLE_2.items()},
        "table_3": {
            "initial": paper_tables.TABLE_3_INITIAL,
            "improved": paper_tables.TABLE_3_IMPROVED,
        },
        **paper_poles.as_json(poles),
        "table_5": {
            "initial": paper_tables.TABLE_5_INITIAL._asdict(),
            "improved": paper_tables.TABLE_5_IMPROVED._asdict(),
        },
        "derivation": _derivation(),
    }


def format_text(found: dict[str, Any], poles: PolesComparison) -> str:
    """The same, to be read."""
    lines = ["Table 1, initial and adjusted coefficients"]
    lines += [
        f"  {name:8s}{row['initial']:9g}{row['adjusted']:9g}"
        for name, row in found["table_1"].items()
    ]
    lines += ["", "Table 2, average squared rate error, initial and adjusted model"]
    lines += [
        f"  {name:18s}{row['initial']:7g}{row['adjusted']:7g}"
        for name, row in found["table_2_deg2ps2"].items()
    ]
    lines += ["", "Table 3, gains, initial and improved"]
    improved = found["table_3"]["improved"]
    lines += [
        f"  {name:10s}{value:8g}{improved[name]:8g}"
        for name, value in found["table_3"]["initial"].items()
    ]
    lines += ["", *paper_poles.format_lines(poles)]
    lines += ["", "Table 5, steady errors, initial and improved controller"]
    improved = found["table_5"]["improved"]
    lines += [
        f"  {name:12s}{value:7g}{improved[name]:7g}"
        for name, value in found["table_5"]["initial"].items()
    ]
    return "\n".join(
        [*lines, "", "Table 1's initial column from first principles", found["derivation"]]
    )


def _derivation() -> str:
    """What the simulator's own derivation prints."""
    command = [sys.executable, "-m", "sitl.vehicle.first_principles"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise OperationError(
            "the derivation failed:"
            f" {(done.stderr.strip().splitlines() or ['no reason given'])[-1]}"
        )
    return done.stdout.rstrip()
