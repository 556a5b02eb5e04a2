"""Logs that are no MCAP, a MAVLink .tlog, an ArduPilot .bin or a PX4 .ulg: looked into and
exported."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ground.client.file_names import safe_file_name
from ground.errors import InputError

if TYPE_CHECKING:
    from sysid.data.readers.samples import MessageColumns


def is_foreign(path: Path) -> bool:
    """Whether a file is one of them; whoever reads MCAP says what is wrong with the rest."""
    from sysid.data import readers
    from sysid.data.dataset import LogError

    try:
        return readers.format_of(path) != "mcap"
    except LogError:
        return False


def info(path: Path) -> dict[str, Any]:
    """Span and messages by name, as `ground.logs.info` has them; nothing numbers the frames. Raises
    BadInputError."""
    found = _tables(path)
    first_s = min(float(table.time_s.min()) for table in found.values())
    last_s = max(float(table.time_s.max()) for table in found.values())
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "first_s": first_s,
        "vehicle_s": last_s - first_s,
        "messages": sum(table.time_s.size for table in found.values()),
        "lost_frames": None,
        "topics": {name: table.time_s.size for name, table in sorted(found.items())},
        "attachments": [],
        "metadata": {},
        "damage": [],
    }


def export_csv(path: Path, out: Path) -> list[Path]:
    """Write each message as a CSV file into folder ``out``, times as the vehicle told them; returns
    the files.

    Raises:
        BadInputError: the log is unreadable.
        FileExistsError: a file of that name is there already.
    """
    found = _tables(path)
    out.mkdir(parents=True, exist_ok=True)
    return [_write(out, name, table) for name, table in sorted(found.items())]


def _tables(path: Path) -> "dict[str, MessageColumns]":
    from sysid.data import readers
    from sysid.data.dataset import LogError

    try:
        return readers.tables(path)
    except LogError as error:
        raise InputError(str(error)) from None


def _write(out: Path, name: str, table: "MessageColumns") -> Path:
    target = out / safe_file_name(name.removeprefix("/mavlink/").replace("/", "-") + ".csv")
    columns = dict(_flatten(table))
    with target.open("x", newline="") as file:
        rows = zip(table.time_s.tolist(), *columns.values(), strict=True)
        csv.writer(file).writerows([["time_s", *columns], *rows])
    return target


def _flatten(table: "MessageColumns") -> Iterator[tuple[str, list[Any]]]:
    """Columns of single values: arrays as ``name[i]``, text as text."""
    for name, values in table.columns.items():
        if values.dtype.kind == "S":
            yield name, [bytes(value).decode("utf-8", "replace") for value in values]
        elif values.ndim == 1:
            yield name, values.tolist()
        else:
            yield from ((f"{name}[{k}]", values[:, k].tolist()) for k in range(np.shape(values)[1]))
