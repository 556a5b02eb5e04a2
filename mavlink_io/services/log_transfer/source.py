"""What the LOG_* service asks of whoever keeps the logs."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol


class LogFile(NamedTuple):
    """One log on disk."""

    path: Path
    number: int
    bytes: int
    began_unix_s: int
    """0 where nobody knows."""


class LogSource(Protocol):
    """The logs of a vehicle."""

    def files(self) -> Sequence[LogFile]:
        """The logs there are, the oldest first."""
        ...

    def erase(self) -> str:
        """Remove all logs but one that is being written; returns why not, or nothing."""
        ...
