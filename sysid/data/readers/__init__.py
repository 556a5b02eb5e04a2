"""Readers of recorded dives: a module for every kind of file, all of which give the same
``Log``."""

from collections.abc import Callable
from pathlib import Path

from sysid.data.dataset import Log, LogError
from sysid.data.readers.samples import MessageColumns
from sysid.data.readers.servo_channels import FIRST_THREE, ServoChannels

FORMATS = "an MCAP log, a MAVLink .tlog, an ArduPilot .bin or a PX4 .ulg"

_FORMAT_BY_MAGIC = {b"\x89MCAP0\r\n": "mcap", b"ULog\x01\x12\x35": "ulog", b"\xa3\x95": "dataflash"}
_FORMAT_BY_SUFFIX = {".mcap": "mcap", ".ulg": "ulog", ".bin": "dataflash", ".tlog": "tlog"}
_STAMP_LENGTH = 8
_FRAME_MAGIC = b"\xfd\xfe"
"""MAVLink 2 and 1. A tlog has no mark of its own: a time stamp, and then a frame."""


def format_of(path: Path) -> str:
    """What sort of log a file is: by how it begins, or else by its suffix.

    Raises:
        LogError: the file cannot be read, or is no log that is known here.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_STAMP_LENGTH + 1)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give {FORMATS}") from None
    for beginning, name in _FORMAT_BY_MAGIC.items():
        if start.startswith(beginning):
            return name
    if len(start) > _STAMP_LENGTH and start[-1] in _FRAME_MAGIC:
        return "tlog"
    if path.suffix.lower() not in _FORMAT_BY_SUFFIX:
        raise LogError(f"{path}: begins like no log; give {FORMATS}")
    return _FORMAT_BY_SUFFIX[path.suffix.lower()]


def read(path: str | Path, outputs: ServoChannels = FIRST_THREE) -> Log:
    """Read one log for identification. ``outputs`` says which of the autopilot's outputs steer.

    Raises:
        LogError: the file is missing, broken, of no known kind, or lacks what identification needs.
    """
    from sysid.data.readers import dataflash, mcap, tlog, ulog

    readers: dict[str, Callable[[Path, ServoChannels], Log]] = {
        "mcap": mcap.read,
        "tlog": tlog.read,
        "dataflash": dataflash.read,
        "ulog": ulog.read,
    }
    path = Path(path)
    return readers[format_of(path)](path, outputs)


def tables(path: Path) -> dict[str, MessageColumns]:
    """Everything that a tlog, .bin or .ulg holds, a table a message. Raises LogError."""
    from sysid.data.readers import dataflash, tlog, ulog

    readers: dict[str, Callable[[Path], dict[str, MessageColumns]]] = {
        "tlog": tlog.tables,
        "dataflash": dataflash.tables,
        "ulog": ulog.tables,
    }
    found = format_of(path)
    if found not in readers:
        raise LogError(f"{path}: is an MCAP log; ground's own tools look into it")
    return readers[found](path)
