"""A list of named checks that a client program runs in order and prints as one JSON object."""

import json
import time
from collections.abc import Callable
from typing import Any

Check = Callable[[Any], Any]


class RefutedError(AssertionError):
    """An observation differs from the expectation; the text contains both."""


def require(seen: object, what: str) -> None:
    """Raise RefutedError unless ``seen`` is true.

    Plain assertions do nothing under ``python -O``, and have no text here.
    """
    if not seen:
        raise RefutedError(what)


def equal(seen: object, expected: object, what: str) -> None:
    require(seen == expected, f"{what} is {seen!r}, not {expected!r}")


def close(seen: float, expected: float, tolerance: float, what: str) -> None:
    require(
        abs(seen - expected) <= tolerance,
        f"{what} is {seen:g}, not {expected:g} within {tolerance:g}",
    )


def name_of(check: Check) -> str:
    return check.__name__.removeprefix("_").replace("_", " ")


def report(verdicts: dict[str, dict[str, Any]]) -> str:
    """Return ``{check: {"pass": ..., "why": ..., "s": ...}}`` from the last line of the output."""
    return json.dumps(verdicts)


def verdict(problem: BaseException | None, began_s: float) -> dict[str, Any]:
    why = (
        ""
        if problem is None
        else f"{type(problem).__name__}: {problem}".replace("RefutedError: ", "")
    )
    return {"pass": problem is None, "why": why, "s": round(time.monotonic() - began_s, 2)}


def failed(verdicts: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Return the failed checks with their reasons."""
    return {name: result["why"] for name, result in verdicts.items() if not result["pass"]}


def score(verdicts: dict[str, dict[str, Any]]) -> str:
    """Return the pass count, such as ``41/41``."""
    return f"{sum(result['pass'] for result in verdicts.values())}/{len(verdicts)}"
