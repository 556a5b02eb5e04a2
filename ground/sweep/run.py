"""Runs of a sweep: fly its dives, keep their rows, and describe the sweep in its folder."""

import csv
import io
import json
import platform
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

from ground.output_files import temporary_name, write_whole
from mavlink_io.errors import InputError
from mavlink_io.text_files import parse_json, read_text
from sysid.sweep import dives, parts
from sysid.sweep.dives import COLUMNS, Part
from sysid.sweep.points import ParameterRange
from sysid.sweep.sweep_request import Chunks, SweepRequest
from sysid.trials import Engine, map_trials, source_hash

DESCRIPTION = "sweep.json"
"""File in the folder of a sweep: what was flown with which versions."""
MAX_DIVES = 999_999_999
"""Largest number of dives, for nine digits in the names of parts."""
Report = Callable[[int, int], None]
"""Receive the number of completed dives and of all dives."""


def run(
    request: SweepRequest,
    folder: Path,
    *,
    jobs: int,
    engine: Engine | None = None,
    report: Report | None = None,
) -> dict[str, Any]:
    """Fly the dives of a sweep that the folder does not hold yet.

    Parameters
    ----------
    request : SweepRequest
        The sweep.
    folder : Path
        Folder of the results; it may hold those of an earlier run.
    jobs : int
        Number of local processes.
    engine : Engine, optional
        What flies the dives; without it processes of this machine do.
    report : Report, optional
        Callback for progress.

    Returns
    -------
    dict
        Description of the sweep, with the digest of all rows.

    Raises
    ------
    InputError
        The autopilot rejects a mission, or the folder is not that of a sweep.
    TrialsError
        The processes die, or the cluster.
    """
    chunks = Chunks(request)
    if chunks.dives > MAX_DIVES:
        raise InputError(f"{request.name}: {chunks.dives} dives: must be at most {MAX_DIVES}")
    store = parts.PartStore(folder)
    description = _description(request, chunks)
    _prepare(folder, description)

    def on_result(done: int) -> None:
        """Report the completed dives."""
        if report:
            report(min(done * request.chunk, chunks.dives), chunks.dives)

    map_trials(
        dives.fly_chunk, chunks, Part, jobs=jobs, keep=store, on_result=on_result, engine=engine
    )
    description |= {"complete": True, "digest": parts.digest(folder)}
    _write(folder, description)
    return description


def fly_one(request: SweepRequest, number: int) -> dict[str, str]:
    """Fly one dive of a sweep.

    Parameters
    ----------
    request : SweepRequest
        The sweep.
    number : int
        Number of the dive.

    Returns
    -------
    dict
        Cells of its row by column.

    Raises
    ------
    InputError
        There is no such dive.
    """
    chunks = Chunks(request)
    if not 0 <= number < chunks.dives:
        raise InputError(f"--dive {number}: must be 0 to {chunks.dives - 1}")
    (row,) = dives.rows_of(dives.fly_chunk(chunks.of_dives([number])).text)
    return row


def stored_row(folder: Path, number: int) -> dict[str, str] | None:
    """Return the row of a dive in the folder of a sweep, or None if it has no readable one."""
    try:
        line = parts.line_of(folder, number)
    except InputError:
        return None
    return None if line is None else next(dives.rows_of(line))


def format_row(row: dict[str, str]) -> str:
    """Return a row as CSV with its header, as in the parts."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([COLUMNS, row.values()])
    return text.getvalue().rstrip("\n")


def _description(request: SweepRequest, chunks: Chunks) -> dict[str, Any]:
    """Return what the sweep flies and with which versions."""
    listed = [
        n for n, levels in request.conditions.items() if not isinstance(levels, ParameterRange)
    ]
    return {
        "plan": request.name,
        "dives": chunks.dives,
        "combinations": chunks.combinations,
        "vehicles": [vehicle.name for vehicle in request.vehicles],
        "gains": [gains.name for gains in request.vehicles[0].gains],
        "missions": [mission.name for mission in request.missions],
        "sampled": [name for name in request.conditions if name not in listed],
        "listed": listed,
        "limits": {n: v for n, v in request.limits._asdict().items() if v < float("inf")},
        "sampler": str(request.sampler),
        "samples": request.samples,
        "repeats": request.repeats,
        "seed": request.seed,
        "source": source_hash(),
        "versions": {
            "python": platform.python_version(),
            **{name: metadata.version(name) for name in ("caribou-auv", "numpy", "scipy")},
        },
        "complete": False,
        "digest": None,
    }


def _prepare(folder: Path, description: dict[str, Any]) -> None:
    """Make the folder and write its description. Raises InputError."""
    folder.mkdir(parents=True, exist_ok=True)
    names = {path.name for path in folder.iterdir()} - {temporary_name(DESCRIPTION)}
    if names and DESCRIPTION not in names:
        raise InputError(f"--out {folder}: is not the folder of a sweep; give a new one")
    _write(folder, description)


def _write(folder: Path, description: dict[str, Any]) -> None:
    """Write the description of a sweep in one step."""
    write_whole(folder / DESCRIPTION, json.dumps(description, indent=1) + "\n")


def read_description(folder: Path) -> dict[str, Any]:
    """Return the description of a sweep.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.

    Returns
    -------
    dict
        Content of `sweep.json`.

    Raises
    ------
    InputError
        The folder is not that of a sweep.
    """
    try:
        description = parse_json(read_text(folder / DESCRIPTION))
    except (OSError, ValueError):
        raise InputError(f"{folder}: is not the folder of a sweep") from None
    if not isinstance(description, dict) or "dives" not in description:
        raise InputError(f"{folder / DESCRIPTION}: is not the description of a sweep")
    return description
