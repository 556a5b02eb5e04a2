"""Log folder: numbered files; the oldest are removed to make room for the newest."""

import contextlib
import fcntl
import os
import re
import shutil
from collections.abc import Callable
from datetime import UTC, datetime
from errno import ENOSPC
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mavlink_io.services.log_transfer.source import LogFile
from mavlink_io.user_data_dir import user_data_dir

BYTES_PER_MB = 1_000_000
_NAME = re.compile(r"(\d{5,})-(\d{8}T\d{6}Z)\.mcap")
_STAMP = "%Y%m%dT%H%M%SZ"


class StorageLimits(NamedTuple):
    """Limits of the disk space of logs."""

    max_mb: float
    """Maximum size of all logs together (MB)."""
    min_free_mb: float
    """Minimum free space of the disk (MB)."""


def default_folder() -> Path:
    """Return the default log folder."""
    return user_data_dir() / "logs"


class LogStore:
    """Logs in a folder, named by number and start time: ``00012-20260131T120000Z.mcap``."""

    def __init__(self, folder: Path, in_use: Callable[[], Path | None] = lambda: None) -> None:
        """Use ``folder``; ``in_use`` returns the path of the open log, which is never removed."""
        self.folder, self._in_use = folder, in_use

    def files(self) -> list[LogFile]:
        """Return the logs, the oldest first; none when the folder cannot be read."""
        try:
            entries = [(_NAME.fullmatch(entry.name), entry) for entry in os.scandir(self.folder)]
            logs = [
                LogFile(
                    path=Path(entry.path),
                    number=int(name[1]),
                    bytes=entry.stat().st_size,
                    began_unix_s=_unix_s(name[2]),
                )
                for name, entry in entries
                if name and entry.is_file(follow_symlinks=False)
            ]
        except OSError:
            return []
        return sorted(logs, key=lambda log: log.number)

    def create(self, unix_s: float, limits: StorageLimits) -> tuple[Path, BinaryIO]:
        """Make room and open the next log; return its path and file. Raises OSError.

        The file is locked until it is closed, so that no other autopilot removes it.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        self.make_room(limits)
        number = max((log.number for log in self.files()), default=0) + 1
        stamp = datetime.fromtimestamp(unix_s, UTC).strftime(_STAMP)
        while True:
            path = self.folder / f"{number:05d}-{stamp}.mcap"
            try:
                file = path.open("xb")
            except FileExistsError:  # another autopilot uses the same folder
                number += 1
                continue
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(file, fcntl.LOCK_SH)
            return path, file

    def make_room(self, limits: StorageLimits) -> None:
        """Remove the oldest logs until the limits are met. Raises OSError when they cannot be.

        Nothing is removed if the free space would still be too small without all logs.
        """
        removable = self._removable()
        used = sum(log.bytes for log in self.files())
        missing_bytes = limits.min_free_mb * BYTES_PER_MB - self._free_bytes()
        if missing_bytes > sum(log.bytes for log in removable):  # other data fill the disk
            raise OSError(ENOSPC, f"no room left for logs in {self.folder}")
        while (
            used > limits.max_mb * BYTES_PER_MB
            or self._free_bytes() < limits.min_free_mb * BYTES_PER_MB
        ):
            if not removable:
                raise OSError(ENOSPC, f"no room left for logs in {self.folder}")
            oldest = removable.pop(0)
            oldest.path.unlink(missing_ok=True)
            used -= oldest.bytes

    def erase(self) -> str:
        """Remove all logs except open ones; return the error text, "" for success."""
        try:
            for log in self._removable():
                log.path.unlink(missing_ok=True)
        except OSError as error:
            return f"Logs not erased: {error.strerror}"
        return ""

    def _removable(self) -> list[LogFile]:
        """Return the logs that no autopilot writes, the oldest first."""
        in_use = self._in_use()
        return [log for log in self.files() if log.path != in_use and not _is_locked(log.path)]

    def _free_bytes(self) -> int:
        """Return the free space of the disk."""
        return shutil.disk_usage(self.folder).free


def _is_locked(path: Path) -> bool:
    """Return whether an autopilot holds the lock of its open log."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # removed by another autopilot, or a file system without locks
        return False
    return False


def _unix_s(stamp: str) -> int:
    """Return the UNIX time of a file name; 0 when it is not a valid time."""
    try:
        return round(datetime.strptime(stamp, _STAMP).replace(tzinfo=UTC).timestamp())
    except ValueError:
        return 0
