"""Checks of the files that a command writes, before its work."""

import os
from collections.abc import Iterable
from pathlib import Path

from mavlink_io.errors import InputError


def check_output(option: str, path: Path, used: Iterable[Path | str | None] = ()) -> Path:
    """Check a file that a command writes at the end of its work.

    Parameters
    ----------
    option : str
        Option that names the file, for the message.
    path : Path
        The file; an existing one will be overwritten.
    used : iterable of Path, str or None
        Other files of the command: those that it reads, and its other outputs. A name of something
        that is no file, and None, are allowed.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    InputError
        The file is one of `used`, also by a link or another spelling.
    """
    for other in used:
        if other is not None and is_same_file(path, Path(other)):
            raise InputError(
                f"{option} {path}: is the same file as {other}, which this command reads or writes"
                " too; give another name"
            )
    return path


def new_file(path: Path) -> Path:
    """Return the path. Raises InputError if the file exists or its folder does not."""
    if path.exists():
        raise InputError(f"{path}: exists; give a new name")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    return path


def is_same_file(path: Path, other: Path) -> bool:
    """Return whether two paths lead to one file.

    Parameters
    ----------
    path, other : Path
        Paths of files that need not exist.

    Returns
    -------
    bool
        True also for symbolic links, hard links and other spellings of a path.
    """
    try:
        return path.samefile(other)
    except OSError:
        return os.path.realpath(path) == os.path.realpath(other)
