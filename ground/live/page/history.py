"""Bounded history of one dive for the live page."""

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
"""Number of rows at which the older half is thinned: every second row of it is dropped. An hour is
then kept at about a row a second, and the last minutes completely."""


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
            self._rows[:half] = self._rows[:half:2]

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
