"""The paper's Tables 1 to 5 and the derivation of Table 1's initial column, without a campaign."""

import subprocess
import sys
from typing import Any

from ground.report import paper_poles
from ground.report.paper_poles import PolesComparison
from mavlink_io.errors import OperationError
from sysid.reproduction import paper_tables


def collect(poles: PolesComparison) -> dict[str, Any]:
    """Return the printed tables, the computed Table 4 and the first-principles derivation.

    Parameters
    ----------
    poles : PolesComparison
        Result of `paper_poles.compute`.

    Raises
    ------
    OperationError
        If the derivation fails.
    """
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


def format_text(tables: dict[str, Any], poles: PolesComparison) -> str:
    """Return the result of `collect` as text."""
    lines = ["Table 1, initial and adjusted coefficients"]
    lines += [
        f"  {name:8s}{row['initial']:9g}{row['adjusted']:9g}"
        for name, row in tables["table_1"].items()
    ]
    lines += ["", "Table 2, average squared rate error, initial and adjusted model"]
    lines += [
        f"  {name:18s}{row['initial']:7g}{row['adjusted']:7g}"
        for name, row in tables["table_2_deg2ps2"].items()
    ]
    lines += ["", "Table 3, gains, initial and improved"]
    improved = tables["table_3"]["improved"]
    lines += [
        f"  {name:10s}{value:8g}{improved[name]:8g}"
        for name, value in tables["table_3"]["initial"].items()
    ]
    lines += ["", *paper_poles.format_lines(poles)]
    lines += ["", "Table 5, steady errors, initial and improved controller"]
    improved = tables["table_5"]["improved"]
    lines += [
        f"  {name:12s}{value:7g}{improved[name]:7g}"
        for name, value in tables["table_5"]["initial"].items()
    ]
    return "\n".join(
        [*lines, "", "Table 1's initial column from first principles", tables["derivation"]]
    )


def _derivation() -> str:
    """Return the output of the simulator's derivation program."""
    command = [sys.executable, "-m", "sitl.vehicle.first_principles"]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode:
        raise OperationError(
            "the derivation failed:"
            f" {(process.stderr.strip().splitlines() or ['no reason given'])[-1]}"
        )
    return process.stdout.rstrip()
