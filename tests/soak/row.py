"""Rows of the soak table: numbered cases, counts that add up, and results that are kept."""

import json
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

MAX_FAILURES = 20
"""Number of failures whose text is kept."""
LARGEST = "max "
"""Prefix of a count of which batches keep the largest value; other counts are added."""


class Batch:
    """Counts and failures of a number of cases."""

    def __init__(self) -> None:
        self.counts: dict[str, float] = {}
        self.failures: list[str] = []

    def add(self, name: str, value: float = 1.0) -> None:
        """Add to a count, or keep the largest value."""
        before = self.counts.get(name, 0.0)
        self.counts[name] = max(before, value) if name.startswith(LARGEST) else before + value

    def fail(self, case: int, text: str) -> None:
        """Count a failure with the number of its case."""
        self.add("failures")
        if len(self.failures) < MAX_FAILURES:
            self.failures.append(f"case {case}: {text}")

    def merge(self, other: "Batch") -> None:
        """Add another batch."""
        for name, value in other.counts.items():
            self.add(name, value)
        self.failures = (self.failures + other.failures)[:MAX_FAILURES]


def no_details(counts: Mapping[str, float]) -> list[str]:
    """Return no lines."""
    return []


class Row(NamedTuple):
    """One row of the table."""

    title: str
    full_size: int
    """Number of cases that the requirement names."""
    batch_size: int
    """Number of cases between two saves of the result."""
    run: Callable[[int, int], Batch]
    """Run cases by number of the first and count."""
    describe: Callable[[Mapping[str, float]], str]
    """Return the result as text."""
    holds: Callable[[Mapping[str, float]], bool]
    """Return whether the result meets the requirement."""
    requirement: str
    details: Callable[[Mapping[str, float]], list[str]] = no_details
    """Return lines to print below the table."""


class Result:
    """Result of a row in a file, which continues after an interruption."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.cases, self.seconds, self.batch = 0, 0.0, Batch()
        if path.exists():
            stored = json.loads(path.read_text())
            self.cases, self.seconds = stored["cases"], stored["seconds"]
            self.batch.counts, self.batch.failures = stored["counts"], stored["failures"]

    def extend(self, row: Row, size: int, stop_s: float = math.inf) -> None:
        """Run cases up to a size or to a time of the wall clock; save the result of each batch."""
        while self.cases < size and time.monotonic() < stop_s:
            count = min(row.batch_size, size - self.cases)
            began_s = time.monotonic()
            self.batch.merge(row.run(self.cases, count))
            self.seconds += time.monotonic() - began_s
            self.cases += count
            self._save()

    def _save(self) -> None:
        """Replace the file."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        temporary = self._path.with_suffix(".new")
        content = {
            "cases": self.cases,
            "seconds": self.seconds,
            "counts": self.batch.counts,
            "failures": self.batch.failures,
        }
        temporary.write_text(json.dumps(content, indent=1))
        temporary.replace(self._path)
