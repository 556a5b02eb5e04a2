"""Results of a sweep on disk: parts of rows in CSV, which pandas and DuckDB read.

A part has the rows of one chunk. Its name holds the number of its first dive and the key of the
chunk, a hash of inputs and source code. It is written under another name and renamed when it is
complete, so that a sweep may be killed at any time.
"""

import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from mavlink_io.errors import InputError
from sysid.sweep.dives import COLUMNS, Part

HEADER = ",".join(COLUMNS) + "\n"
"""First line of a part."""
PARTS, SUPERSEDED = "parts", "superseded"
"""Folders of the parts of the last sweep, and of those of another plan or source code."""
_NAME = re.compile(r"part-(\d{9})-([0-9a-f]{16})\.csv")


class PartStore:
    """The parts in a folder; a store for ``sysid.trials.map_trials``.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._superseded = folder / PARTS, folder / SUPERSEDED

    def prepare(self, keys: Sequence[str]) -> None:
        """Move parts with other keys to the folder `superseded`, and drop unfinished files.

        Parameters
        ----------
        keys : sequence of str
            Keys of all chunks of the sweep.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        for unfinished in self._folder.glob("*.tmp"):
            unfinished.unlink(missing_ok=True)
        wanted = {key[:16] for key in keys}
        self._files = dict[str, Path]()
        for path, key in _parts(self._folder):
            if key in wanted:
                self._files[key] = path
            else:
                self._superseded.mkdir(exist_ok=True)
                path.replace(self._superseded / path.name)

    def get(self, key: str) -> Part | None:
        """Return number and count of the rows of a part, or None.

        Parameters
        ----------
        key : str
            Key of the chunk.

        Returns
        -------
        Part or None
            Without its text; None if there is no such part, or if it is damaged.
        """
        path = self._files.get(key[:16])
        if path is None:
            return None
        try:
            rows = read(path).count("\n")
        except InputError:
            return None
        return Part(int(_number(path)), rows, "")

    def add(self, key: str, result: Part) -> Part:
        """Write a part.

        Parameters
        ----------
        key : str
            Key of the chunk.
        result : Part
            Rows.

        Returns
        -------
        Part
            The part without its text.
        """
        path = self._folder / f"part-{result.first:09d}-{key[:16]}.csv"
        unfinished = path.with_suffix(f".{os.getpid()}.tmp")
        with unfinished.open("w", encoding="utf-8", newline="") as file:
            file.write(HEADER + result.text)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
        return result._replace(text="")


def read(path: Path) -> str:
    """Return the rows of a part without the header.

    Parameters
    ----------
    path : Path
        Part.

    Returns
    -------
    str
        Lines of CSV.

    Raises
    ------
    InputError
        The file is no complete part of this version.
    """
    text = path.read_text(encoding="utf-8")
    if not text.startswith(HEADER) or not text.endswith("\n"):
        raise InputError(f"{path}: is no part of a sweep of this version; run the sweep again")
    return text[len(HEADER) :]


def texts(folder: Path) -> Iterator[str]:
    """Yield the rows of each part of a sweep, in the order of the dives.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.

    Yields
    ------
    str
        Lines of CSV without a header.
    """
    for path, _ in sorted(_parts(folder / PARTS)):
        yield read(path)


def line_of(folder: Path, number: int) -> str | None:
    """Return the row of a dive, or None.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.
    number : int
        Number of the dive.

    Returns
    -------
    str or None
        Line of CSV; None if the folder does not hold the dive.
    """
    earlier = [path for path, _ in _parts(folder / PARTS) if int(_number(path)) <= number]
    if not earlier:
        return None
    part = max(earlier)
    lines = read(part).splitlines()[number - int(_number(part)) :]
    return lines[0] if lines else None


def digest(folder: Path) -> str:
    """Return the SHA-256 of all rows in the order of the dives, whatever the size of the chunks.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    summed = hashlib.sha256(HEADER.encode())
    for text in texts(folder):
        summed.update(text.encode())
    return summed.hexdigest()


def _parts(folder: Path) -> Iterator[tuple[Path, str]]:
    """Yield path and key of each part in a folder."""
    for path in folder.iterdir() if folder.is_dir() else ():
        if match := _NAME.fullmatch(path.name):
            yield path, match[2]


def _number(path: Path) -> str:
    """Return the number of the first dive in the name of a part."""
    match = _NAME.fullmatch(path.name)
    assert match, "the path is that of a part"
    return match[1]
