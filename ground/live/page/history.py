"""Bounded history of one dive for the live page."""

import math
from typing import NamedTuple

Row = tuple[float | None, ...]
"""Values of `COLUMNS`; None without a value."""
COLUMNS = (
    "time_s",
    "depth_m",
    "heading_deg",
    "pitch_deg",
    "roll_deg",
    "rudder",
    "elevator",
    "thrust",
    "depth_setpoint_m",
    "heading_setpoint_deg",
    "pitch_setpoint_deg",
    "north_m",
    "east_m",
)
MAX_ROWS = 4000
"""Number of rows at which the older half is thinned; the newer half is complete."""
MAX_OLD_ROWS = 1500
"""Number of rows to which the older half is thinned, evenly in time: of an hour they are at most
5 s apart."""


class _Numbered(NamedTuple):
    number: int
    row: Row


class History:
    """Rows of one dive with running numbers, thinned with age."""

    def __init__(self) -> None:
        self._rows: list[_Numbered] = []
        self.count = 0
        """Number of rows that were ever added."""

    def add(self, row: Row) -> None:
        """Add a row."""
        self._rows.append(_Numbered(self.count, row))
        self.count += 1
        if len(self._rows) > MAX_ROWS:
            half = len(self._rows) // 2
            self._rows[:half] = _thinned(self._rows[:half])

    def since(self, number: int) -> list[Row]:
        """Return the rows that are kept of those numbered ``number`` and later."""
        new = list[Row]()
        for numbered in reversed(self._rows):
            if numbered.number < number:
                break
            new.append(numbered.row)
        new.reverse()
        return new

    def clear(self) -> None:
        """Drop all rows; the numbers continue."""
        self._rows = []


def _thinned(rows: list[_Numbered]) -> list[_Numbered]:
    """Return at most `MAX_OLD_ROWS` of the rows, at nearly even intervals of time."""
    times_s = [numbered.row[0] or 0.0 for numbered in rows]
    period_s = (times_s[-1] - times_s[0]) / (MAX_OLD_ROWS - 1)
    chosen, due_s = list[_Numbered](), -math.inf
    for numbered, time_s in zip(rows, times_s, strict=True):
        if time_s >= due_s:
            chosen.append(numbered)
            due_s = time_s + period_s
    return chosen
