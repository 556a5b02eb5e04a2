"""Log folder: numbered files; the oldest are removed to make room for the newest."""

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
        """Make room and open the next log; return its path and file. Raises OSError."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.make_room(limits)
        number = max((log.number for log in self.files()), default=0) + 1
        stamp = datetime.fromtimestamp(unix_s, UTC).strftime(_STAMP)
        while True:
            path = self.folder / f"{number:05d}-{stamp}.mcap"
            try:
                return path, path.open("xb")
            except FileExistsError:  # another autopilot uses the same folder
                number += 1

    def make_room(self, limits: StorageLimits) -> None:
        """Remove the oldest logs until the limits are met. Raises OSError when they cannot be."""
        removable = [log for log in self.files() if log.path != self._in_use()]
        used = sum(log.bytes for log in self.files())
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
        """Remove all logs except the open one; return the error text, "" for success."""
        try:
            for log in self.files():
                if log.path != self._in_use():
                    log.path.unlink(missing_ok=True)
        except OSError as error:
            return f"Logs not erased: {error.strerror}"
        return ""

    def _free_bytes(self) -> int:
        """Return the free space of the disk."""
        return shutil.disk_usage(self.folder).free


def _unix_s(stamp: str) -> int:
    """Return the UNIX time of a file name; 0 when it is not a valid time."""
    try:
        return round(datetime.strptime(stamp, _STAMP).replace(tzinfo=UTC).timestamp())
    except ValueError:
        return 0
