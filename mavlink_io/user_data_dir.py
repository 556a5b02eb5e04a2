"""Directory for data that a program keeps until its next start, and safe replacement of files."""

import os
from contextlib import suppress
from pathlib import Path


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
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.unlink(missing_ok=True)  # from a killed program; O_EXCL requires a new file
        with os.fdopen(
            os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8"
        ) as file:
            file.write(text)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        error.filename, error.filename2 = str(path), None
        raise
