"""Parameters that outlive the program: what ground has set is on disk before long, and there at the
next start.

The file is written whole or not at all, by a thread of its own: a slow disk must not hold the
vehicle up. One that cannot be read is told and put aside, never a reason not to start."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import count
from pathlib import Path

from autopilot.control.params import ParamError, ParamTable
from autopilot.param_file import lines, to_text
from mavlink_io.clock import Every
from mavlink_io.user_data_dir import replace_file

FILE = "parameters.param"
SAVE_DELAY_S = 0.2
"""Values that come one after the other are written at once."""
_UNSAVED = -1


class ParamStore:
    """The file of a folder; without a folder nothing is kept."""

    def __init__(self, folder: Path | None) -> None:
        self._path = folder / FILE if folder else None
        self._writer = ThreadPoolExecutor(max_workers=1)
        self._writing: Future[None] | None = None
        self._written = 0
        """The table's revision that is on disk, or on its way there."""
        self._failed = False
        """The last that was to be written was not."""
        self._due = Every(SAVE_DELAY_S)
        self.complaints: list[str] = []
        """What was wrong with the file."""

    def load(self) -> dict[str, float]:
        """What was kept. A line that is wrong is left out; the file as it was then lies beside the
        new one."""
        if self._path is None:
            return {}
        try:
            text = self._path.read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            return {}
        except (OSError, UnicodeDecodeError) as error:
            self.complaints.append(f"{self._path}: {getattr(error, 'strerror', None) or 'no text'}")
            self._put_aside(self._path)
            return {}
        values: dict[str, float] = {}
        for number, name, value in lines(text):
            if isinstance(value, ParamError):
                self.complaints.append(f"{self._path}:{number}: {value}; its default is used")
            else:
                values[name] = value
        if self.complaints:
            self._put_aside(self._path)
            self._written = _UNSAVED
        return values

    def poll(self, table: ParamTable, say: Callable[[str], None]) -> None:
        """Write what was set since the last time, and say what went wrong with it."""
        if self._writing is not None and self._writing.done():
            error = self._writing.exception()
            self._writing, self._failed = None, error is not None
            if error is not None:
                say(f"Parameters are not kept: {getattr(error, 'strerror', None) or error}")
        if (
            self._path is None
            or self._writing is not None
            or table.revision == self._written
            or not self._due.due()
        ):
            return
        self._written = table.revision
        self._writing = self._writer.submit(_write, self._path, to_text(table.stored))

    def close(self, table: ParamTable) -> str:
        """Write what is left, and wait for it; returns what went wrong, or nothing."""
        self._writer.shutdown()
        failed = self._failed if self._writing is None else self._writing.exception() is not None
        if self._path is None or (table.revision == self._written and not failed):
            return ""
        try:
            _write(self._path, to_text(table.stored))
        except OSError as error:
            return f"parameters are not kept: {error.strerror}"
        return ""

    def _put_aside(self, path: Path) -> None:
        names = (path.with_name(f"{path.name}.broken-{n}") for n in count(1))
        try:
            aside = next(name for name in names if not name.exists())
            path.replace(aside)
            self.complaints.append(f"put aside as {aside}")
        except OSError as error:
            self.complaints.append(f"cannot be put aside: {error.strerror}")


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, text)
