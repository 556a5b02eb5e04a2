"""Isolation of unexpected exceptions: each is reported once, and the control tick continues."""

import contextlib
import sys
from collections.abc import Callable
from pathlib import Path
from traceback import extract_tb
from typing import ParamSpec, Protocol

from autopilot.control.types import Severity

MAX_TEXT = 150
"""Maximum characters of a report: three STATUSTEXTs."""

P = ParamSpec("P")


class SendText(Protocol):
    """Function that sends a text to every ground station."""

    def __call__(self, text: str, severity: Severity) -> None:
        """Send the text with its severity."""


class Guard:
    """Runs parts of the program that the control tick does not depend on.

    An exception ends only the call that raised it. It is reported once per part and source line, as
    a CRITICAL text and on standard error.
    """

    def __init__(self, send_text: SendText) -> None:
        self._send_text = send_text
        self._reported: set[tuple[str, str]] = set()

    def run(self, part: str, work: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> bool:
        """Call ``work`` as a ``part`` of the program; return whether it raised no exception."""
        try:
            work(*args, **kwargs)
        except Exception as error:
            self.report(part, error)
            return False
        return True

    def report(self, part: str, error: Exception) -> None:
        """Report an unexpected exception, unless the same one was reported before."""
        source_line = _source_line(error)
        if (part, source_line) in self._reported:
            return
        self._reported.add((part, source_line))
        text = f"Internal error in {part}: {type(error).__name__} {error} ({source_line})"[
            :MAX_TEXT
        ]
        self._send_text(text, Severity.CRITICAL)
        print_error(text)


def print_error(text: str) -> None:
    """Print a line on standard error; ignore a terminal that is closed."""
    with contextlib.suppress(OSError, ValueError):
        print(f"autopilot: {text}", file=sys.stderr, flush=True)


def _source_line(error: Exception) -> str:
    """Return file and line of the innermost call, for example ``guidance.py:123``."""
    calls = extract_tb(error.__traceback__)
    return f"{Path(calls[-1].filename).name}:{calls[-1].lineno}" if calls else "unknown place"
