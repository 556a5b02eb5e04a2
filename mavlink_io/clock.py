"""Wall clock, wall-clock timers and the pacing of vehicle time.

Vehicle time may run at any speed in simulation. Protocol timeouts and everything that a person
sees use wall time at every speed.
"""

import time
from collections.abc import Callable

wall_s: Callable[[], float] = time.monotonic
"""Return the monotonic wall clock, in seconds from an arbitrary origin."""


class Interval:
    """A periodic wall-clock timer; periods that were missed are not caught up.

    A call that comes late does not delay the next period.

    Parameters
    ----------
    period_s : float
        Period, in seconds of the clock.
    now : callable
        Return the clock, in seconds.
    """

    def __init__(self, period_s: float, now: Callable[[], float] = wall_s) -> None:
        self._period_s, self._now = period_s, now
        self._next_s = now()

    def due(self) -> bool:
        """Return whether a period has begun since the last call; the first call returns True."""
        late_s = self._now() - self._next_s
        if late_s < 0.0:
            return False
        self._next_s += self._period_s * (late_s // self._period_s + 1.0)
        return True

    def hasten(self) -> None:
        """Make the next call of ``due`` return True; for tests."""
        self._next_s = self._now()


class Pacer:
    """Hold vehicle time to a multiple of the wall clock.

    Parameters
    ----------
    speed : float or None
        Vehicle seconds per wall second; None does not wait at all.
    """

    def __init__(self, speed: float | None) -> None:
        self._speed = speed
        self._start: tuple[float, float] | None = None

    def wait(self, vehicle_s: float) -> None:
        """Sleep until the wall clock reaches a vehicle time; restart if over 1 s late.

        Parameters
        ----------
        vehicle_s : float
            Vehicle time, in seconds.
        """
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
        """Make the present wall time correspond to ``vehicle_s``, for example after a pause.

        Parameters
        ----------
        vehicle_s : float
            Vehicle time, in seconds.
        """
        self._start = wall_s(), vehicle_s
