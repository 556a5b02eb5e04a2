"""Wait times for the answers of PX4: no wait is not lockstep, an unlimited wait can deadlock.

PX4 answers HIL_SENSOR with HIL_ACTUATOR_CONTROLS only while its modules run, and need not answer
every frame: it sends controls when its outputs are updated, which may be every n-th frame.
``AnswerRate`` estimates the period of the answers. The simulator waits for an answer only when one
is due. After a due answer did not arrive, it runs in real time until the next answer.

The time stamp of an answer is PX4's own time, which counts from its first HIL_SENSOR (drv_hrt.cpp,
px4_clock_settime) or from zero, depending on the version. The lag of that clock is therefore
estimated too, as the smallest difference seen between vehicle time and time stamp.
"""

from __future__ import annotations

ANSWER_TIMEOUT_S = 0.5
"""Wall time to wait for a due answer; PX4 reports an error after one second without data."""
MAX_PERIOD_US = 100_000
"""Longest period of answers, in vehicle time; after a longer gap every frame is due again."""
CLOCK_RESTART_US = 1_000_000
"""Increase of the clock's lag above which PX4's clock is taken to have restarted."""


class AnswerRate:
    """Estimate of the rate and lag of one connection's answers, in vehicle time."""

    def __init__(self, tick_us: int) -> None:
        self._tick_us = tick_us
        self._lag_us: int | None = None
        """Vehicle time minus PX4's time; None before the first answer."""
        self._answered_us = 0
        """Vehicle time of the newest answered frame."""
        self._period_us = tick_us
        self.lockstep = False
        """Whether PX4 runs in lockstep and answers."""

    def wait_timeout_s(self, sent_us: int) -> float:
        """Return the wall time to wait for an answer to the frame of ``sent_us``."""
        if not self.lockstep:
            return self._tick_us * 1e-6
        return ANSWER_TIMEOUT_S if sent_us - self._answered_us >= self._period_us else 0.0

    def record_answer(self, stamp_us: int, sent_us: int, lockstep: bool) -> bool:
        """Update the estimate with an answer; return whether it answers the frame of ``sent_us``.

        Parameters
        ----------
        stamp_us : int
            Time stamp of the answer, in PX4's time.
        sent_us : int
            Vehicle time of the last frame sent.
        lockstep : bool
            Whether the answer's lockstep flag is set.
        """
        lag_us = sent_us - stamp_us
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
        return frame_us == sent_us

    def record_timeout(self, sent_us: int) -> None:
        """Record that the frame of ``sent_us`` was not answered in time."""
        if sent_us - self._answered_us >= self._period_us:
            self.lockstep = False
