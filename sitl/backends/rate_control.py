"""How long to wait for PX4: for ever would be a deadlock, not at all would be no lockstep.

PX4 answers a HIL_SENSOR with HIL_ACTUATOR_CONTROLS once its modules run; before that, and whenever
they rest, nothing comes. Nor need every frame be answered: controls go out when its outputs are
renewed, which may be every n-th. So the rhythm of the answers is learnt: a frame whose answer is
due is waited for, the others are not, and after a frame that stayed without its answer the next
ones flow at the pace of the wall clock until one comes.

The stamp of an answer is PX4's own time, which counts from its first HIL_SENSOR (drv_hrt.cpp,
px4_clock_settime) or from zero, by version. So how far it lags behind ours is learnt too: it is the
least lag that was seen."""

from __future__ import annotations

ANSWER_TIMEOUT_S = 0.5
"""Wall time that an answer is waited for when it is due; PX4 itself complains after a second
without data."""
MAX_PERIOD_US = 100_000
"""Answers farther apart than this in vehicle time have no rhythm."""
CLOCK_RESTART_US = 1_000_000
"""An answer later than this was stamped by a clock that began anew."""


class AnswerRate:
    """What is known of the answers of one connection; all times but ``ANSWER_TIMEOUT_S`` are
    vehicle time."""

    def __init__(self, tick_us: int) -> None:
        self._tick_us = tick_us
        self._lag_us: int | None = None
        self._answered_us = 0
        """The newest frame that has been answered."""
        self._period_us = tick_us
        self.lockstep = False
        """Whether PX4 waits for us as we wait for it."""

    def patience_s(self, asked_us: int) -> float:
        """Wall time to wait for an answer to the frame of ``asked_us``."""
        if not self.lockstep:
            return self._tick_us * 1e-6
        return ANSWER_TIMEOUT_S if asked_us - self._answered_us >= self._period_us else 0.0

    def hear(self, stamp_us: int, asked_us: int, lockstep: bool) -> bool:
        """Note an answer that came after the frame of ``asked_us`` was sent; True when it answers
        that frame."""
        lag_us = asked_us - stamp_us
        if (
            self._lag_us is None
            or lag_us < self._lag_us
            or lag_us - self._lag_us > CLOCK_RESTART_US
        ):
            self._lag_us = lag_us
        frame_us = stamp_us + self._lag_us
        if frame_us > self._answered_us:
            gap_us = frame_us - self._answered_us
            self._period_us = gap_us if gap_us <= MAX_PERIOD_US else self._tick_us
            self._answered_us = frame_us
        self.lockstep = lockstep
        return frame_us == asked_us

    def miss(self, asked_us: int) -> None:
        """Note that the wait for an answer to the frame of ``asked_us`` is over."""
        if asked_us - self._answered_us >= self._period_us:
            self.lockstep = False
