"""Files that a command writes: checks before its work, and writing in one step."""

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from mavlink_io.errors import InputError
from mavlink_io.user_data_dir import errors_named

_NO_ROOM = errno.ENOSPC, errno.EDQUOT, errno.EFBIG
"""Errors of a write that name no file."""


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
        The file is one of `used`, also by a link or another spelling; it is a folder or has none;
        or it cannot be written.
    """
    refuse_same_file(option, path, used)
    _refuse_place(f"{option} {path}", path)
    return path


def refuse_same_file(option: str, path: Path, used: Iterable[Path | str | None]) -> None:
    """Raise InputError if a file to be written is one of `used`, as `check_output` does."""
    for other in used:
        if other is not None and is_same_file(path, Path(other)):
            raise InputError(
                f"{option} {path}: is the same file as {other}, which this command reads or writes"
                " too; give another name"
            )


def new_file(path: Path) -> Path:
    """Check the path of a file that a command will create.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Path
        The same path.

    Raises
    ------
    InputError
        The file exists or cannot be written.
    """
    _refuse_place(str(path), path)
    if path.exists():
        raise InputError(f"{path}: exists; give a new name")
    return path


@contextmanager
def open_new(path: Path) -> Iterator[BinaryIO]:
    """Open a new file to write it, and remove it again if the work fails.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    file object
        The file, in binary mode.

    Raises
    ------
    FileExistsError
        The file exists already.
    OSError
        The file cannot be written; a full disk, or a limit of the size that the file exceeds, is
        reported with the name of the file.
    """
    file = path.open("xb")
    try:
        with file:
            yield file
    except BaseException as error:
        path.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            error.filename = str(path)  # a failed write names no file
        raise


def write_whole(path: Path, text: str) -> None:
    """Write a text file so that a kill leaves the old or the new content.

    Parameters
    ----------
    path : Path
        The file. `temporary_name` is that of the part that a kill leaves; the next write replaces
        it.
    text : str
        New content.

    Raises
    ------
    OSError
        The file cannot be written. ``filename`` is that of `path`.
    """
    temporary = path.with_name(temporary_name(path.name))
    with errors_named(path):
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)


def temporary_name(name: str) -> str:
    """Return the name of a file while `write_whole` writes it."""
    return f".{name}.new"


def _refuse_place(label: str, path: Path) -> None:
    """Raise InputError if a file cannot be written at a path."""
    exists = True
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        exists = False
    except OSError as error:  # the name is too long, or links go round in a circle
        raise InputError(f"{label}: {error.strerror}; give another name") from None
    folder = Path(os.path.realpath(path)).parent
    if path.is_dir():
        raise InputError(f"{label}: is a folder; give the name of a file")
    if not exists and not folder.is_dir():
        raise InputError(f"{label}: there is no folder {folder}; make it, or give another name")
    if not os.access(path if exists else folder, os.W_OK):
        reason = "the file" if exists else f"the folder {folder}"
        raise InputError(f"{label}: {reason} is not writable; give another name")


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
