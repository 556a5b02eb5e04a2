"""Jumps of a mission that is followed item by item to check it. Pure.

A pass is what is flown between two jumps from the same item. Passes that begin alike (position,
depth, thrust), and in which no other counted jump is taken, are alike: only the first ones and the
last one are followed, the time of those between is added. An endless jump ends by the battery
failsafe; what it repeats must take time.
"""

import math
from collections.abc import Hashable
from typing import NamedTuple

from autopilot.control.mission import MissionFault
from mavlink_io.mission_items import MissionItem

MAX_IDLE_PASSES = 1000
"""Maximum count of a jump whose pass takes no time: 4 s at 50 Hz and two items in a pass
(mission.ITEMS_PER_TICK)."""


class Jump(NamedTuple):
    """Result of a DO_JUMP."""

    target: int
    """Next item."""
    skipped_s: float = 0.0
    """Time of the passes that need not be followed."""


class _Pass(NamedTuple):
    """Begin of a pass."""

    state: Hashable
    taken: int
    """Number of counted jumps taken before, the one of this pass included."""
    used_s: float


class Jumps:
    """Counts of the jumps of a mission, and their last passes.

    Parameters
    ----------
    counts : tuple of (int, int)
        Sequence and count of each jump that has been taken.
    available_s : float
        Time until the battery is low (s).
    """

    def __init__(self, counts: tuple[tuple[int, int], ...], available_s: float) -> None:
        self._counts, self._available_s = dict(counts), available_s
        self._taken = 0
        """Number of counted jumps that have been taken."""
        self._passes: dict[int, _Pass] = {}
        """Last pass of each jump."""
        self.repeats_endlessly = False
        """Whether an endless jump back has been taken."""

    def take(self, item: MissionItem, state: Hashable, used_s: float) -> Jump | MissionFault | None:
        """Follow a DO_JUMP.

        Parameters
        ----------
        item : MissionItem
            The jump.
        state : Hashable
            What the next items depend on, without the time.
        used_s : float
            Time until this jump (s).

        Returns
        -------
        Jump, MissionFault or None
            Next item; the fault of a repetition that takes no time; None if the mission repeats for
            ever what has been followed.
        """
        sequence = item.sequence
        count = self._counts.get(sequence, 0)
        remaining = item.p2 - count if item.p2 >= 0.0 else math.inf
        if remaining <= 0.0:
            return Jump(sequence + 1)
        self.repeats_endlessly |= math.isinf(remaining) and item.p1 <= sequence
        last, skipped, pass_s = self._passes.get(sequence), 0, 0.0
        if last is not None and (last.state, last.taken) == (state, self._taken):
            pass_s = used_s - last.used_s
            if pass_s == 0.0 and remaining + count > MAX_IDLE_PASSES:
                return MissionFault(sequence, "DO_JUMP repeats items that take no time", 1)
            if math.isinf(remaining):
                return None
            possible = (self._available_s - used_s) / pass_s if pass_s > 0.0 else math.inf
            skipped = math.floor(min(remaining - 1.0, possible))
        if math.isfinite(remaining):
            self._counts[sequence] = count + 1 + skipped
            self._taken += 1
        self._passes[sequence] = _Pass(state, self._taken, used_s + skipped * pass_s)
        return Jump(int(item.p1), skipped * pass_s)
