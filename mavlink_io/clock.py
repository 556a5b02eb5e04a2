"""Two clocks: vehicle time, which the simulator may run at any speed, and wall time.

People and protocol timeouts live in wall time, whatever the speed-up.
"""

import time
from collections.abc import Callable

wall_s: Callable[[], float] = time.monotonic
"""Seconds of the wall clock that never steps back."""


class Every:
    """A wall-clock timer: due once a period, without trying to catch up."""

    def __init__(self, period_s: float, now: Callable[[], float] = wall_s) -> None:
        self._period_s, self._now = period_s, now
        self._next_s = now()

    def due(self) -> bool:
        """Whether a period has passed since it last was (true at the first call)."""
        now = self._now()
        if now < self._next_s:
            return False
        self._next_s = now + self._period_s
        return True

    def hasten(self) -> None:
        """Be due at the next call."""
        self._next_s = self._now()


class Pacer:
    """Holds vehicle time to a multiple of the wall clock; ``speed`` None lets it run free."""

    def __init__(self, speed: float | None) -> None:
        self._speed = speed
        self._start: tuple[float, float] | None = None

    def wait(self, vehicle_s: float) -> None:
        """Sleep until the wall clock has reached ``vehicle_s``."""
        if self._speed is None:
            return
        if self._start is None:
            self.restart(vehicle_s)
        assert self._start is not None
        wall_at_start, vehicle_at_start = self._start
        delay = wall_at_start + (vehicle_s - vehicle_at_start) / self._speed - wall_s()
        if delay > 0:
            time.sleep(delay)
        elif delay < -1.0:
            self.restart(vehicle_s)

    def restart(self, vehicle_s: float) -> None:
        """Count from here, after a pause or where the machine could not keep up."""
        self._start = wall_s(), vehicle_s
