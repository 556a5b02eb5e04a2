"""The folder of logs: numbered files, of which the oldest make room for the newest."""

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
    """How much room logs may take."""

    most_mb: float
    """All of them together."""
    free_mb: float
    """What the disk must keep free."""


def default_folder() -> Path:
    """Where logs lie when nobody says."""
    return user_data_dir() / "logs"


class LogStore:
    """The logs in a folder, named by number and by when they began:
    ``00012-20260131T120000Z.mcap``."""

    def __init__(self, folder: Path, in_use: Callable[[], Path | None] = lambda: None) -> None:
        """``in_use`` tells which log is being written; it is never removed."""
        self.folder, self._in_use = folder, in_use

    def files(self) -> list[LogFile]:
        """The logs there are, the oldest first; none where the folder cannot be read."""
        try:
            entries = [(_NAME.fullmatch(entry.name), entry) for entry in os.scandir(self.folder)]
            found = [
                LogFile(Path(entry.path), int(name[1]), entry.stat().st_size, _unix_s(name[2]))
                for name, entry in entries
                if name and entry.is_file(follow_symlinks=False)
            ]
        except OSError:
            return []
        return sorted(found, key=lambda log: log.number)

    def create(self, unix_s: float, limits: StorageLimits) -> tuple[Path, BinaryIO]:
        """Open the next log, the oldest removed where there is no room. Raises OSError."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.make_room(limits)
        number = max((log.number for log in self.files()), default=0) + 1
        stamp = datetime.fromtimestamp(unix_s, UTC).strftime(_STAMP)
        while True:
            path = self.folder / f"{number:05d}-{stamp}.mcap"
            try:
                return path, path.open("xb")
            except FileExistsError:  # another autopilot writes here too
                number += 1

    def make_room(self, limits: StorageLimits) -> None:
        """Remove the oldest logs until the limits are kept. Raises OSError when that is not
        enough."""
        removable = [log for log in self.files() if log.path != self._in_use()]
        used = sum(log.bytes for log in self.files())
        while (
            used > limits.most_mb * BYTES_PER_MB
            or self._free_bytes() < limits.free_mb * BYTES_PER_MB
        ):
            if not removable:
                raise OSError(ENOSPC, f"no room left for logs in {self.folder}")
            oldest = removable.pop(0)
            oldest.path.unlink(missing_ok=True)
            used -= oldest.bytes

    def erase(self) -> str:
        """Remove all logs but the one that is being written; returns why not, or nothing."""
        try:
            for log in self.files():
                if log.path != self._in_use():
                    log.path.unlink(missing_ok=True)
        except OSError as error:
            return f"Logs not erased: {error.strerror}"
        return ""

    def _free_bytes(self) -> int:
        return shutil.disk_usage(self.folder).free


def _unix_s(stamp: str) -> int:
    try:
        return round(datetime.strptime(stamp, _STAMP).replace(tzinfo=UTC).timestamp())
    except ValueError:
        return 0
