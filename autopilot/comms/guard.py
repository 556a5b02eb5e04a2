"""Reports an unexpected exception beside the tick once, and lets the vehicle fly on."""

import contextlib
import sys
from collections.abc import Callable
from pathlib import Path
from traceback import extract_tb
from typing import ParamSpec, Protocol

from autopilot.control.types import Severity

MAX_TEXT = 150
"""Characters of a report: three STATUSTEXTs."""

P = ParamSpec("P")


class Say(Protocol):
    """Sends a text to every ground station."""

    def __call__(self, text: str, severity: Severity) -> None: ...


class Guard:
    """Runs parts of the program that the tick does not depend on.

    An exception ends the call that raised it and nothing else. It is reported once for each part
    and place in the source, as a CRITICAL text and on standard error."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._reported: set[tuple[str, str]] = set()

    def run(self, part: str, work: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> bool:
        """Do some ``work`` of a ``part`` of the program; returns whether it was done."""
        try:
            work(*args, **kwargs)
        except Exception as error:
            self.report(part, error)
            return False
        return True

    def report(self, part: str, error: Exception) -> None:
        """Report an unexpected exception, unless the same one was reported before."""
        place = _place(error)
        if (part, place) in self._reported:
            return
        self._reported.add((part, place))
        text = f"Internal error in {part}: {type(error).__name__} {error} ({place})"[:MAX_TEXT]
        self._say(text, Severity.CRITICAL)
        print_error(text)


def print_error(text: str) -> None:
    """Print a line on standard error. A terminal that is gone is no reason to stop."""
    with contextlib.suppress(OSError, ValueError):
        print(f"autopilot: {text}", file=sys.stderr, flush=True)


def _place(error: Exception) -> str:
    """Return file and line of the innermost call, such as ``guidance.py:123``."""
    calls = extract_tb(error.__traceback__)
    return f"{Path(calls[-1].filename).name}:{calls[-1].lineno}" if calls else "unknown place"
