"""Writes to the disk: in a thread, and with errors that name the file and what to do."""

import fcntl
import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from errno import EACCES, EDQUOT, EFBIG, ENOSPC, EPERM, EROFS
from itertools import count
from pathlib import Path

from mavlink_io.clock import Interval

_REMEDIES = {
    **dict.fromkeys((ENOSPC, EDQUOT, EFBIG), "free space on the disk"),
    **dict.fromkeys((EACCES, EPERM, EROFS), "make the folder writable"),
}
_OTHER_REMEDY = "check the disk"


def disk_error_text(error: BaseException) -> str:
    """Return reason and file of an error of the disk, and what the user can do."""
    if not isinstance(error, OSError):
        return f"internal error: {type(error).__name__} {error}"
    file = f": {error.filename}" if error.filename else ""
    return f"{error.strerror or error}{file}; {_REMEDIES.get(error.errno or 0, _OTHER_REMEDY)}"


def rename_broken(path: Path) -> str:
    """Rename a file with errors to the first free ``NAME.broken-N``; return what was done."""
    names = (path.with_name(f"{path.name}.broken-{number}") for number in count(1))
    try:
        backup = next(name for name in names if not name.exists())
        path.replace(backup)
    except OSError as error:
        return f"cannot be renamed: {error.strerror}"
    return f"renamed to {backup.name}"


def lock_folder(folder: Path) -> bool:
    """Lock a folder until this process ends; return whether no other process has locked it.

    A folder that cannot be created, or on a file system without locks, counts as free.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return True  # the first write reports it
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return False
    except OSError:
        pass
    return True


class BackgroundWriter:
    """Runs one write at a time in a thread, so that a slow disk never delays a tick."""

    def __init__(self, content: str, period_s: float) -> None:
        """Name what is written; ``period_s`` is the shortest wall time between two writes."""
        self._content = content
        self._executor = ThreadPoolExecutor(max_workers=1)
        self._write: Future[None] | None = None
        self._due = Interval(period_s)
        self._failed = False

    def ready(self, report: Callable[[str], None]) -> bool:
        """Return whether the next write may start; report the first of several failures."""
        if self._write is not None:
            if not self._write.done():
                return False
            error, self._write = self._write.exception(), None
            if error is not None and not self._failed:
                report(f"{self._content} not stored: {disk_error_text(error)}; the dive goes on")
            self._failed = error is not None
        return self._due.due()

    def start(self, write: Callable[[], None]) -> None:
        """Start a write; it raises OSError when it fails."""
        self._write = self._executor.submit(write)

    def close(self) -> None:
        """Wait for the write in progress."""
        self._executor.shutdown()
