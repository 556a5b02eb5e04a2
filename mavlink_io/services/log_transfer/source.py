"""The logs of a vehicle, as the server of the LOG_* messages needs them."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol


class LogFile(NamedTuple):
    """One log on disk."""

    path: Path
    number: int
    """Number in the name of the file."""
    bytes: int
    """Size of the file."""
    began_unix_s: int
    """UNIX time of the beginning of the log, in seconds; 0 if unknown."""


class LogSource(Protocol):
    """The logs of a vehicle."""

    def files(self) -> Sequence[LogFile]:
        """Return the logs, the oldest first."""
        ...

    def erase(self) -> str:
        """Remove all logs except an open one; return the reason of a failure, "" for success."""
        ...
