"""Parameters on disk: values that ground sets are stored, and loaded at the next start.

A separate thread writes the file, whole or not at all, so that a slow disk never delays a tick. A
file that cannot be read is reported and renamed; the autopilot starts without it.
"""

from collections.abc import Callable
from pathlib import Path

from autopilot.control.params import ParamError, ParamTable
from autopilot.disk import BackgroundWriter, disk_error_text, rename_broken
from autopilot.param_file import lines, to_text
from mavlink_io.text_files import read_text
from mavlink_io.user_data_dir import replace_file

FILE = "parameters.param"
SAVE_DELAY_S = 0.2
"""Shortest time between two writes: values that arrive within it are written together."""
_UNSAVED = -1
"""Revision number of a file that differs from the table."""


class ParamStore:
    """The parameter file in a folder; without a folder nothing is stored."""

    def __init__(self, folder: Path | None) -> None:
        self._path = folder / FILE if folder else None
        self._writer = BackgroundWriter("Parameters", SAVE_DELAY_S)
        self._written = 0
        """Revision of the table that is on disk."""
        self.problems: list[str] = []
        """Problems of the file, found when it was loaded."""

    def load(self) -> dict[str, float]:
        """Return the stored values, without lines that are not valid.

        A file with such a line is renamed, so that the next write does not destroy it.
        """
        if self._path is None:
            return {}
        try:
            text = read_text(self._path)
        except (FileNotFoundError, NotADirectoryError):
            return {}
        except (OSError, UnicodeDecodeError) as error:
            self.problems.append(f"{self._path}: {getattr(error, 'strerror', None) or 'no text'}")
            self.problems.append(rename_broken(self._path))
            return {}
        values: dict[str, float] = {}
        for number, name, value in lines(text):
            if isinstance(value, ParamError):
                self.problems.append(f"{self._path}:{number}: {value}; its default is used")
            else:
                values[name] = value
        if self.problems:
            self.problems.append(rename_broken(self._path))
            self._written = _UNSAVED
        return values

    def poll(self, table: ParamTable, report: Callable[[str], None]) -> None:
        """Start to write the values set since the last write, and report a write that failed."""
        if self._path is None or not self._writer.ready(report):
            return
        if table.revision != self._written:
            text, revision = to_text(table.stored), table.revision
            self._writer.start(lambda: self._write(text, revision))

    def close(self, table: ParamTable) -> str:
        """Write unsaved values and wait for it. Return the error text, "" for success."""
        self._writer.close()
        if self._path is None or table.revision == self._written:
            return ""
        try:
            self._write(to_text(table.stored), table.revision)
        except OSError as error:
            return f"parameters are not stored: {disk_error_text(error)}"
        return ""

    def _write(self, text: str, revision: int) -> None:
        """Replace the file, and create its folder where it is missing. Raises OSError."""
        assert self._path is not None, "without a folder nothing is written"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(self._path, text)
        self._written = revision
