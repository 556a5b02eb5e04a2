"""Patience of the lockstep: when to send a frame again, and when to give the autopilot up."""

from __future__ import annotations

import time
from collections.abc import Callable

from mavlink_io.clock import wall_s
from mavlink_io.records import ActuatorFrame
from sitl.backends.hil import HilClient

FIRST_ANSWER_TIMEOUT_S = 60.0
ANSWER_TIMEOUT_S = 5.0
FREE_RUN_S = 0.02
"""Pace of frames that nobody answers yet, or that wait for the vehicle to be armed."""
RESEND_S = 0.1
RESEND_GROWTH = 1.5
RESEND_MAX_S = 0.5


class AutopilotTimeoutError(ConnectionError):
    """Nobody answers, or nobody does any more."""


class Lockstep:
    """Asks one question at a time and insists on its answer. All times here are wall time."""

    def __init__(self, link: HilClient, stopped: Callable[[], bool]) -> None:
        self._link, self._stopped = link, stopped
        self._has_answered = False

    def ask(self, datagram: bytes, time_us: int) -> ActuatorFrame | None:
        """The answer to the sensors of ``time_us``; None when the process was told to stop
        meanwhile.

        Raises:
            AutopilotSilentError: no answer within 60 s at first, within 5 s later.
            LinkLostError: the other end is gone for good.
        """
        give_up_s = wall_s() + (ANSWER_TIMEOUT_S if self._has_answered else FIRST_ANSWER_TIMEOUT_S)
        resend_s = RESEND_S if self._has_answered else FREE_RUN_S
        while not self._stopped():
            self._link.send(datagram)
            answer = self._answer_until(time_us, wall_s() + resend_s)
            if answer is not None:
                self._has_answered = True
                return answer
            if wall_s() > give_up_s:
                raise AutopilotTimeoutError(self._complaint(time_us))
            if self._has_answered:
                resend_s = min(RESEND_MAX_S, RESEND_GROWTH * resend_s)
        return None

    def ask_until_armed(self, datagram: bytes, time_us: int) -> ActuatorFrame | None:
        """Like ``ask``, again and again until the answer says that the vehicle is armed: vehicle
        time stands still."""
        while (answer := self.ask(datagram, time_us)) is not None and not answer.armed:
            time.sleep(FREE_RUN_S)
        return answer

    def _answer_until(self, time_us: int, deadline_s: float) -> ActuatorFrame | None:
        """The answer if it arrives in time; others may arrive before it."""
        while (left_s := deadline_s - wall_s()) > 0.0:
            answer = self._link.answer(time_us, left_s)
            if answer is not None:
                return answer
        return None

    def _complaint(self, time_us: int) -> str:
        if self._has_answered:
            return f"the autopilot stopped answering at vehicle time {time_us * 1e-6:.2f} s"
        return (
            f"no autopilot has answered on {self._link.address} for {FIRST_ANSWER_TIMEOUT_S:.0f} s"
        )
