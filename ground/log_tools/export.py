"""Export logs of all formats: CSV and .mat in SI units, .tlog, and MCAP for log viewers."""

import csv
from collections.abc import Iterator, Mapping
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from ground.client.file_names import safe_file_name
from ground.log_tools import viewer_log
from ground.log_tools.formats import ExportFormat
from ground.log_tools.si_units import TIME, si_columns
from ground.output_files import open_new
from mavlink_io import dialect
from mavlink_io.codec import encode_payload
from mavlink_io.errors import InputError
from mavlink_io.logging.mcap_reader import McapChannel, McapMessage, McapReader
from mavlink_io.logging.tlog import TelemetryLog
from sysid.data import readers, segments, state_table
from sysid.data.dataset import Log, LogError

STATE = "state"
"""Name of the table with the state of the vehicle."""
PARAMETERS = "parameters"
"""Name of the table with the parameters."""


def default_target(path: Path, export_format: ExportFormat) -> Path:
    """Return where an export is written by default.

    Parameters
    ----------
    path : Path
        The log.
    export_format : ExportFormat
        Format of the export.

    Returns
    -------
    Path
        A folder for CSV, else a file; `run.mcap` becomes `run`, `run.mat`, `run.tlog` or
        `run-view.mcap`.
    """
    if export_format == ExportFormat.CSV:
        return path.with_suffix("")
    if export_format == ExportFormat.MCAP:
        return path.with_name(f"{path.stem}-view.mcap")
    return path.with_suffix(f".{export_format}")


def export(path: Path, target: Path, export_format: ExportFormat) -> list[Path]:
    """Write a log in another format.

    Parameters
    ----------
    path : Path
        The log, of any format that `sysid.data.readers` reads.
    target : Path
        Folder for CSV, else a new file.
    export_format : ExportFormat
        Format of the export.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    InputError
        The log cannot be read or is damaged, or has no content for this format.
    FileExistsError
        A file to be written exists already.
    """
    match export_format:
        case ExportFormat.CSV:
            return export_csv(path, target)
        case ExportFormat.MAT:
            export_mat(path, target)
        case ExportFormat.TLOG:
            export_tlog(path, target)
        case ExportFormat.MCAP:
            viewer_log.write(path, readers.read(path), target)
    return [target]


def export_csv(path: Path, out: Path) -> list[Path]:
    """Write each message type as a CSV file, `state.csv` and `parameters.csv`.

    The first column is the time in s. The other columns are the fields in SI units with the unit
    in the name; an array becomes the columns ``name[i]``. An unknown value is an empty cell.

    Parameters
    ----------
    path : Path
        Log file.
    out : Path
        Folder for the CSV files; created if missing.

    Returns
    -------
    list of Path
        Written files. A log without attitude, commands and depth has no `state.csv` and no
        `parameters.csv`; `state.csv` has no columns without any value.

    Raises
    ------
    InputError
        The log cannot be read or is damaged.
    FileExistsError
        A file to be written exists already.
    """
    tables = _message_tables(path)
    out.mkdir(parents=True, exist_ok=True)
    written = list[Path]()
    try:
        for name, columns in sorted(tables.items()):
            written.append(_write_csv(out / _csv_name(name), dict(_flatten(columns))))
        log = _state_log(path)
        if log is not None:
            parameters: dict[str, list[Any]] = {
                "name": list(log.parameters),
                "value": list(log.parameters.values()),
            }
            written.append(write_state(log, out / f"{STATE}.csv"))
            written.append(_write_csv(out / f"{PARAMETERS}.csv", parameters))
    except BaseException:  # the next attempt would refuse them as existing
        for file in written:
            file.unlink()
        raise
    return written


def write_state(log: Log, target: Path) -> Path:
    """Write the state of the vehicle as a new CSV file, which `ground refit` reads.

    The column ``loop_hz`` gives the rate of the autopilot's loops in every row, if it is known: a
    fit needs it for the delay.

    Parameters
    ----------
    log : Log
        A recorded or simulated dive.
    target : Path
        File to write.

    Returns
    -------
    Path
        `target`.

    Raises
    ------
    FileExistsError
        `target` exists already.
    """
    state: dict[str, list[Any]] = dict(_flatten(_without_empty(state_table.state_table(log))))
    state["test"] = state_table.tested_surfaces(log)
    if loop_hz := segments.loop_rate_hz(log.parameters):
        state["loop_hz"] = [loop_hz] * len(state["test"])
    return _write_csv(target, state)


def export_mat(path: Path, target: Path) -> None:
    """Write a log as a new MATLAB 5 file.

    It has a structure ``state``, a structure ``parameters`` and one structure per message with the
    columns of the CSV export; an array is a matrix with one row per message.

    Parameters
    ----------
    path : Path
        Log file.
    target : Path
        File to write.

    Raises
    ------
    InputError
        The log cannot be read or is damaged.
    FileExistsError
        `target` exists already.
    """
    content: dict[str, dict[str, Any]] = {
        _mat_name(name): {_mat_name(key): _mat_values(v) for key, v in columns.items()}
        for name, columns in _message_tables(path).items()
    }
    log = _state_log(path)
    if log is not None:
        content[STATE] = dict(state_table.state_table(log))
        content[PARAMETERS] = {_mat_name(k): v for k, v in sorted(log.parameters.items())}
    with open_new(target) as file:
        savemat(file, content, long_field_names=True, do_compression=True, oned_as="column")


def export_tlog(path: Path, target: Path) -> None:
    """Write the MAVLink messages of an MCAP log as a telemetry log with intact frames.

    Parameters
    ----------
    path : Path
        Log file.
    target : Path
        File to write.

    Raises
    ------
    InputError
        The log is not an MCAP log, has no MAVLink message, or is damaged.
    FileExistsError
        `target` exists already.
    """
    if readers.format_of(path) != "mcap":
        raise InputError(
            f"{path}: --format tlog is for MCAP logs; {path.suffix or 'this format'} holds no"
            " MAVLink messages in MCAP channels"
        )
    readers.load(path)  # refuses an unfinished or damaged log
    with open_new(target) as output, path.open("rb") as file:
        _copy_frames(McapReader(file, _is_mavlink), TelemetryLog(output))


def _copy_frames(reader: McapReader, log: TelemetryLog) -> None:
    """Write each message of an MCAP log as a frame."""
    senders: dict[int, tuple[dialect.MessageType, int, int]] = {}
    for item in reader.items():
        if isinstance(item, McapChannel) and _is_mavlink(item):
            _, _, system, component, name = item.topic.split("/")
            senders[item.number] = dialect.by_name(name), int(system), int(component)
        elif isinstance(item, McapMessage):
            message, *sender = senders[item.channel]
            frame = encode_payload(message, item.data, item.sequence & 0xFF, *sender)
            log.write(item.time_ns // 1000, frame)


def _is_mavlink(channel: McapChannel) -> bool:
    """Return whether a channel contains a message of the dialect."""
    parts = channel.topic.split("/")
    return (
        len(parts) == 5
        and parts[1] == "mavlink"
        and parts[2].isdigit()
        and parts[3].isdigit()
        and parts[4] in dialect.names()
    )


def _message_tables(path: Path) -> dict[str, dict[str, NDArray[Any]]]:
    """Return the columns of each message in SI units by topic, the time first."""
    return {
        topic: {TIME: table.time_s, **si_columns(topic, table.columns)}
        for topic, table in readers.load(path).tables.items()
    }


def _state_log(path: Path) -> Log | None:
    """Return the log for the state of the vehicle; None if it lacks a necessary message."""
    try:
        return readers.read(path)
    except LogError:
        return None


def _without_empty(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns that have a value."""
    return {name: values for name, values in columns.items() if not np.isnan(values).all()}


def _csv_name(topic: str) -> str:
    """Return the file name of a message."""
    return safe_file_name(topic.removeprefix("/mavlink/").replace("/", "-") + ".csv")


def _mat_name(topic: str) -> str:
    """Return a valid MATLAB name of a message or column: letters, digits and underscores."""
    name = topic.removeprefix("/mavlink/")
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return (name if name[:1].isalpha() else f"m{name}")[:63]


def _mat_values(values: NDArray[Any]) -> NDArray[Any]:
    """Return values that a .mat file can hold: texts as Unicode."""
    if values.dtype.kind != "S":
        return values
    return np.array([bytes(value).decode("utf-8", "replace") for value in values], dtype=object)


def _write_csv(target: Path, columns: Mapping[str, list[Any]]) -> Path:
    """Write columns as a new CSV file, and return its path."""
    with open_new(target) as data, TextIOWrapper(data, encoding="utf-8", newline="") as file:
        rows = zip(*columns.values(), strict=True)
        csv.writer(file, lineterminator="\n").writerows([list(columns), *rows])
    return target


def _flatten(columns: Mapping[str, NDArray[Any]]) -> Iterator[tuple[str, list[Any]]]:
    """Yield name and cells of each column; an array becomes the columns ``name[i]``."""
    for name, values in columns.items():
        if values.ndim > 1:
            for k in range(values.shape[1]):
                yield f"{name}[{k}]", _cells(values[:, k])
        else:
            yield name, _cells(values)


def _cells(values: NDArray[Any]) -> list[Any]:
    """Return the cells of a column: texts, numbers, and an empty cell for NaN."""
    if values.dtype.kind == "S":
        return [bytes(value).decode("utf-8", "replace") for value in values]
    if values.dtype.kind != "f":
        return list(values.tolist())
    return ["" if value != value else value for value in values.tolist()]
