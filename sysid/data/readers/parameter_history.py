"""Parameters of an autopilot over the time of a log.

A servo that is reversed after the dive moved the other way before. So the outputs are scaled with
the parameters of their own time.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from sysid.data.dataset import Array


class ParameterHistory(NamedTuple):
    """Parameters at the start of a log, and their changes."""

    first: dict[str, float]
    """First value of each parameter, which counts from the start of the log."""
    changes: tuple[tuple[float, str, float], ...] = ()
    """Vehicle time (s), name and value of each change, in the order of the log."""

    def latest(self) -> dict[str, float]:
        """Return the last value of each parameter."""
        return self.first | {name: value for _, name, value in self.changes}

    def epochs(
        self, time_s: Array, beginnings: tuple[str, ...]
    ) -> Iterator[tuple[slice, dict[str, float]]]:
        """Yield the rows between two changes, and the parameters that hold for them.

        Parameters
        ----------
        time_s : ndarray, shape (n,)
            Vehicle time of the rows. A row before the one above it, after a step of the clock,
            counts as later.
        beginnings : tuple of str
            Beginnings of the names of those parameters whose changes count.

        Yields
        ------
        slice
            Rows; at least one, if there is any.
        dict
            Parameters.
        """
        changes = [change for change in self.changes if change[1].startswith(beginnings)]
        ends = np.searchsorted(np.maximum.accumulate(time_s), [change[0] for change in changes])
        values, start = dict(self.first), 0
        for (_, name, value), end in zip(changes, ends.tolist(), strict=True):
            if end > start:
                yield slice(start, end), values
                start = end
            values[name] = value
        if start < time_s.size or not time_s.size:
            yield slice(start, time_s.size), values


def history_of(values: Iterable[tuple[float, str, float]]) -> ParameterHistory:
    """Return the history of parameters.

    Parameters
    ----------
    values : iterable of tuple
        Vehicle time (s), name and value of each message, in the order of the log.

    Returns
    -------
    ParameterHistory
        First values, and the messages with another value than the one before.
    """
    first, known, changes = dict[str, float](), dict[str, float](), []
    for time_s, name, value in values:
        if name not in first:
            first[name] = value
        elif known[name] != value:
            changes.append((time_s, name, value))
        known[name] = value
    return ParameterHistory(first, tuple(changes))
