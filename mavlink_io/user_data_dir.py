"""Directory for data that a program keeps until its next start, and safe replacement of files."""

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


def user_data_dir() -> Path:
    """Return the user's state directory for these programs (XDG Base Directory Specification).

    Returns
    -------
    Path
        ``$XDG_STATE_HOME/caribou``, by default ``~/.local/state/caribou``. It may not exist.
    """
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "caribou"


def replace_file(path: Path, text: str, *, durable: bool = True) -> None:
    """Replace a file by a new one that only its owner can read, in one atomic step.

    Parameters
    ----------
    path : Path
        The file; it may not exist.
    text : str
        New content, written as UTF-8.
    durable : bool
        Whether to wait until the content is on the disk and survives a loss of power. Without it
        the content survives the end of the program.

    Raises
    ------
    OSError
        The file cannot be written; the old file is unchanged. ``filename`` is that of ``path``.
    """
    with errors_named(path):
        _replace(path, text.encode("utf-8"), 0o600, durable=durable)


def write_output(path: str | Path, content: str | bytes) -> None:
    """Write a file that a user named, in one atomic step: a failure leaves the old content.

    Parameters
    ----------
    path : str or Path
        The file. An existing one keeps its permissions, and a symbolic link its target. A device,
        a pipe, and a file in a folder that takes no new files are written in place.
    content : str or bytes
        New content; text is written as UTF-8.

    Raises
    ------
    OSError
        The file cannot be written. ``filename`` is that of ``path``.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    target, exists = Path(os.path.realpath(path)), Path(path).exists()
    with errors_named(path):
        if exists and not (target.is_file() and os.access(target.parent, os.W_OK)):
            Path(path).write_bytes(data)
        else:
            _replace(target, data, target.stat().st_mode & 0o777 if exists else None, durable=True)


def open_output(path: Path, mode: Literal["wb", "ab", "xb"] = "wb") -> io.BufferedWriter:
    """Open a file that is written during the work of a program; a failed write names the file.

    Parameters
    ----------
    path : Path
        The file.
    mode : str
        What is done with an old file: it is overwritten ("wb"), continued ("ab") or an error
        ("xb").

    Returns
    -------
    file object
        The file, in binary mode.

    Raises
    ------
    OSError
        The file cannot be opened.
    """
    return io.BufferedWriter(_NamedFile(path, mode))


class _NamedFile(io.FileIO):
    """File that names itself in the OSError of a failed write, which the system does not."""

    def write(self, data: "ReadableBuffer", /) -> int:  # FileIO returns None if non-blocking
        """Write bytes and return their number."""
        with errors_named(str(self.name)):
            return super().write(data) or 0


@contextmanager
def errors_named(path: str | Path) -> Iterator[None]:
    """Name the file in an OSError of the block.

    Parameters
    ----------
    path : str or Path
        The file that the block writes.

    Yields
    ------
    None
        Nothing.

    Raises
    ------
    OSError
        That of the block; its ``filename`` is that of ``path``.
    """
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _replace(path: Path, data: bytes, mode: int | None, *, durable: bool) -> None:
    """Write a file beside `path` and rename it; None is the mode of a new file. Raises OSError."""
    # the name of the file is cut, so that a long one stays within the limit of the disk
    temporary = path.with_name(f".{path.name[:50]}.{os.getpid()}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        temporary.unlink(missing_ok=True)  # from a killed program; O_EXCL requires a new file
        with os.fdopen(os.open(temporary, flags, 0o666 if mode is None else 0o600), "wb") as file:
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        if mode is not None:
            temporary.chmod(mode)
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
