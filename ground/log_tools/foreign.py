"""Inspect and export logs in other formats: MAVLink .tlog, ArduPilot .bin and PX4 .ulg."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ground.client.file_names import safe_file_name
from sysid.data import readers
from sysid.data.dataset import LogError
from sysid.data.readers.samples import MessageColumns


def is_foreign(path: Path) -> bool:
    """Return whether a file is a log in another format; unknown files count as MCAP."""
    try:
        return readers.format_of(path) != "mcap"
    except LogError:
        return False


def info(path: Path) -> dict[str, Any]:
    """Return duration and messages by name, with the keys of `mcap.info`.

    ``lost_frames`` is None because these logs contain no sequence numbers.

    Raises
    ------
    InputError
        The log cannot be read.
    """
    tables, damage = readers.load(path)
    first_s = min(float(table.time_s.min()) for table in tables.values())
    last_s = max(float(table.time_s.max()) for table in tables.values())
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "first_s": first_s,
        "vehicle_s": last_s - first_s,
        "messages": sum(table.time_s.size for table in tables.values()),
        "lost_frames": None,
        "topics": {name: table.time_s.size for name, table in sorted(tables.items())},
        "attachments": [],
        "metadata": {},
        "damage": [damage] if damage else [],
    }


def export_csv(path: Path, out: Path) -> list[Path]:
    """Write each message type as a CSV file, with vehicle time in s.

    Parameters
    ----------
    path : Path
        Log file.
    out : Path
        Folder for the CSV files; created if missing.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    InputError
        The log cannot be read.
    FileExistsError
        A file to be written exists already.
    """
    tables = readers.load(path).tables
    out.mkdir(parents=True, exist_ok=True)
    return [_write(out, name, table) for name, table in sorted(tables.items())]


def _write(out: Path, name: str, table: MessageColumns) -> Path:
    """Write a table as a new CSV file and return its path."""
    target = out / safe_file_name(name.removeprefix("/mavlink/").replace("/", "-") + ".csv")
    columns = dict(_flatten(table))
    with target.open("x", newline="") as file:
        rows = zip(table.time_s.tolist(), *columns.values(), strict=True)
        csv.writer(file).writerows([["time_s", *columns], *rows])
    return target


def _flatten(table: MessageColumns) -> Iterator[tuple[str, list[Any]]]:
    """Yield name and values of each column; an array becomes the columns ``name[i]``."""
    for name, values in table.columns.items():
        if values.dtype.kind == "S":
            yield name, [bytes(value).decode("utf-8", "replace") for value in values]
        elif values.ndim == 1:
            yield name, values.tolist()
        else:
            yield from ((f"{name}[{k}]", values[:, k].tolist()) for k in range(np.shape(values)[1]))
