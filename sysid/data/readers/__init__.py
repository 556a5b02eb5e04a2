"""Readers of recorded dives: one module per file format; all return the same ``Log``."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mavlink_io.text_files import open_regular
from sysid.data.dataset import DEFAULT_TRAVEL_DEG, Log, LogError
from sysid.data.readers.samples import FileDamage, MessageColumns, format_damage, without_ahead
from sysid.data.readers.servo_channels import FROM_LOG, TRAVEL, TRIMS, OutputOptions

FORMATS = "an MCAP log, a MAVLink .tlog, an ArduPilot .bin, a PX4 .ulg or a .csv"

MAX_TRAVEL_DEG = 90.0
"""Largest travel of a surface to either side."""

_FORMAT_BY_MAGIC = {b"\x89MCAP0\r\n": "mcap", b"ULog\x01\x12\x35": "ulog", b"\xa3\x95": "dataflash"}
_FORMAT_BY_SUFFIX = {
    ".mcap": "mcap",
    ".ulg": "ulog",
    ".bin": "dataflash",
    ".tlog": "tlog",
    ".csv": "csv",
}
_COMPRESSION_BY_MAGIC = {
    b"\x1f\x8b": "gzip",
    b"PK\x03\x04": "zip",
    b"BZh": "bzip2",
    b"\xfd7zXZ\x00": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"7z\xbc\xaf\x27\x1c": "7-Zip",
}
_STAMP_LENGTH = 8
_FRAME_MAGIC = b"\xfd\xfe"
"""First bytes of MAVLink 2 and 1 frames.

A tlog has no signature: it begins with a time stamp of 8 bytes and a frame."""


def format_of(path: Path) -> str:
    """Return the format of a log file from its first bytes, or else from its suffix.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        "mcap", "tlog", "dataflash", "ulog" or "csv".

    Raises
    ------
    LogError
        The file cannot be read, is compressed, or its format is unknown.
    """
    try:
        with open_regular(path) as file:
            start = file.read(_STAMP_LENGTH + 1)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give {FORMATS}") from None
    for magic, program in _COMPRESSION_BY_MAGIC.items():
        if start.startswith(magic):
            raise LogError(f"{path}: is compressed ({program}); unpack it, and give the log in it")
    for magic, name in _FORMAT_BY_MAGIC.items():
        if start.startswith(magic):
            return name
    if len(start) > _STAMP_LENGTH and start[-1] in _FRAME_MAGIC:
        return "tlog"
    if path.suffix.lower() not in _FORMAT_BY_SUFFIX:
        raise LogError(f"{path}: not a log of a known format; give {FORMATS}")
    return _FORMAT_BY_SUFFIX[path.suffix.lower()]


def read(path: str | Path, options: OutputOptions = FROM_LOG) -> Log:
    """Read one log for identification.

    Parameters
    ----------
    path : str or Path
        MCAP log, MAVLink .tlog, ArduPilot .bin, PX4 .ulg or CSV file.
    options : OutputOptions
        Output numbers of rudder, elevator and thrust, and the vehicle's travel.

    Returns
    -------
    Log
        Arrays in MAVLink's axes, vehicle time.

    Raises
    ------
    LogError
        The file is missing, damaged, of unknown format, or has not all data for identification.
    """
    from sysid.data.readers import csv_table, dataflash, mcap, tlog, ulog

    readers: dict[str, Callable[[Path, OutputOptions], Log]] = {
        "mcap": mcap.read,
        "tlog": tlog.read,
        "dataflash": dataflash.read,
        "ulog": ulog.read,
        "csv": csv_table.read,
    }
    path = Path(path)
    with np.errstate(all="ignore"):  # damaged logs hold NaN, infinity and signalling NaN
        log = readers[format_of(path)](path, options)
    series = {
        "attitude": log.attitude.time_s,
        "commands": log.actuators.time_s,
        "depth": log.depth.time_s,
    }
    for name, time_s in series.items():
        if time_s.size < 2:
            raise LogError(
                f"{path}: holds {time_s.size} usable samples of {name}; identification needs"
                " attitude, commands and depth throughout"
            )
    travel_deg = log.parameters.get(TRAVEL, DEFAULT_TRAVEL_DEG)
    if not 0.0 < travel_deg <= MAX_TRAVEL_DEG:
        raise LogError(
            f"{path}: {TRAVEL} = {travel_deg:g}; the travel of the surfaces lies between 0 and"
            f" {MAX_TRAVEL_DEG:g} deg"
        )
    for name in TRIMS:
        if not abs(trim_deg := log.parameters.get(name, 0.0)) <= MAX_TRAVEL_DEG:
            raise LogError(
                f"{path}: {name} = {trim_deg:g}; a trim lies between -{MAX_TRAVEL_DEG:g} and"
                f" {MAX_TRAVEL_DEG:g} deg"
            )
    return log


class LogContent(NamedTuple):
    """All messages of a log."""

    tables: dict[str, MessageColumns]
    """Columns by message name."""
    damage: str
    """Damaged places of the file and the time that is lost; empty for a whole file."""


def load(path: Path) -> LogContent:
    """Read all messages of a log.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    LogContent
        Columns by message name, and the damage.

    Raises
    ------
    LogError
        The file is missing, of unknown format, or cannot be read; an MCAP log also if it is
        damaged.
    """
    from sysid.data.readers import csv_table, dataflash, mcap, tlog, ulog

    readers: dict[str, Callable[[Path], tuple[dict[str, MessageColumns], FileDamage]]] = {
        "mcap": mcap.load,
        "tlog": tlog.load,
        "dataflash": dataflash.load,
        "ulog": ulog.load,
        "csv": csv_table.load,
    }
    with np.errstate(all="ignore"):
        tables, damage = readers[format_of(path)](path)
    if not tables:
        raise LogError(f"{path}: holds no message with a time")
    ahead_s = list[float]()
    for name, table in tables.items():
        tables[name], times_s = without_ahead(table)
        ahead_s += times_s
    damage = damage._replace(contradicted_s=tuple(sorted((*damage.contradicted_s, *ahead_s))))
    regular = max(tables.values(), key=lambda table: table.time_s.size)
    return LogContent(tables, format_damage(damage, regular.time_s))
