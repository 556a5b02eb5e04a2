"""What a program keeps for its next start: where it lies, and how it is written."""

import os
from pathlib import Path


def user_data_dir() -> Path:
    """The user's state directory for these programs (XDG Base Directory Specification)."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "caribou"


def replace_file(path: Path, text: str) -> None:
    """Put a whole new file in place of an old one, readable by its owner alone.

    Raises:
        OSError: it cannot be written; the old file is as it was.
    """
    half = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with os.fdopen(
            os.open(half, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8"
        ) as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        half.replace(path)
    except OSError:
        half.unlink(missing_ok=True)
        raise
