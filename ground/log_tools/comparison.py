"""Comparison of dives: errors of heading, pitch and depth side by side."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from mavlink_io.errors import InputError
from sysid.data import readers
from sysid.data.dataset import Log
from sysid.monitor import tracking_metrics


class DiveErrors(NamedTuple):
    """Errors of one dive on constant set-points, after settling; NaN without any interval."""

    name: str
    heading_deg: float
    """95 % of the heading errors are within this distance of zero."""
    pitch_deg: float
    """95 % of the pitch about its own mean."""
    depth_m: float
    legs: int
    """Number of intervals of constant set-points."""


class Comparison(NamedTuple):
    """Errors of several dives; printing it gives a table."""

    dives: tuple[DiveErrors, ...]

    def __str__(self) -> str:
        """Return a table with one line per dive."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        """Yield the lines of the table."""
        width = max(len(dive.name) for dive in self.dives)
        yield f"{'95 % of the error':{width}s}  heading, deg  pitch, deg  depth, m  legs"
        width = max(width, len("95 % of the error"))
        for dive in self.dives:
            yield (
                f"{dive.name:{width}s}  {dive.heading_deg:12.2f}  {dive.pitch_deg:10.2f}"
                f"  {dive.depth_m:8.3f}  {dive.legs:4d}"
            )


def compare(dives: Mapping[str, Log | str | Path]) -> Comparison:
    """Compare the errors of dives.

    Parameters
    ----------
    dives : mapping
        Logs, or paths of logs, by the names that the table shows.

    Returns
    -------
    Comparison
        Errors of each dive.

    Raises
    ------
    CaribouError
        `dives` is no mapping or is empty, or a log cannot be read.
    """
    if not isinstance(dives, Mapping) or not dives:
        raise InputError(
            f"dives = {dives!r}: expected at least one log by its name, such as"
            ' {"before": "a.mcap", "after": "b.mcap"}'
        )
    return Comparison(tuple(_errors(name, dive) for name, dive in dives.items()))


def _errors(name: str, dive: Log | str | Path) -> DiveErrors:
    """Return the errors of one dive."""
    log = dive if isinstance(dive, Log) else readers.read(dive)
    metrics = tracking_metrics.tracking(log)
    if metrics is None:
        return DiveErrors(name, math.nan, math.nan, math.nan, legs=0)
    return DiveErrors(
        name=name,
        heading_deg=metrics.heading_deg.p95,
        pitch_deg=metrics.pitch_deg.p95,
        depth_m=metrics.depth_m.p95,
        legs=len(metrics.windows),
    )
