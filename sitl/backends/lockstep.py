"""Lockstep with Caribou's autopilot: when to repeat a sensor frame, and when to give up."""

from __future__ import annotations

import time
from collections.abc import Callable

from mavlink_io.clock import wall_s
from mavlink_io.errors import ErrorCode, OperationError
from mavlink_io.records import ActuatorFrame
from sitl.backends.hil import HilClient

FIRST_ANSWER_TIMEOUT_S = 60.0
"""Wall time to wait for the first answer of a run."""
ANSWER_TIMEOUT_S = 20.0
"""Wall time to wait for each later answer: an overloaded machine can leave the autopilot without a
processor for more than 5 s."""
FREE_RUN_S = 0.02
"""Repetition period of frames before the first answer, and while the vehicle is disarmed."""
RESEND_S = 0.1
"""Wall time after which an unanswered frame is sent again."""
RESEND_GROWTH = 1.5
"""Factor by which that time grows with each repetition."""
RESEND_MAX_S = 0.5
"""Upper limit of that time."""


class AutopilotTimeoutError(OperationError, ConnectionError):
    """The autopilot does not answer, or has stopped answering."""

    code = ErrorCode.AUTOPILOT_TIMEOUT


class Lockstep:
    """Lockstep exchange: one sensor datagram at a time, repeated until it is answered.

    All times are wall time.
    """

    def __init__(self, link: HilClient, stopped: Callable[[], bool]) -> None:
        self._link, self._stopped = link, stopped
        self.has_answered = False
        """Whether an answer has been received, by ``exchange`` or by the caller."""

    def exchange(
        self, datagram: bytes, time_us: int, *, sent: bool = False
    ) -> ActuatorFrame | None:
        """Return the answer to the sensors of ``time_us``; None when asked to stop meanwhile.

        ``sent`` states that the datagram has already been sent once.

        Raises
        ------
        AutopilotTimeoutError
            No answer arrives within 60 s at first, or within 20 s later.
        LinkLostError
            The link is closed and cannot be opened again.
        """
        timeout_s = ANSWER_TIMEOUT_S if self.has_answered else FIRST_ANSWER_TIMEOUT_S
        # Sum of the waits, not wall time: a pause of the whole machine is no silence.
        waited_s = 0.0
        resend_s = RESEND_S if self.has_answered else FREE_RUN_S
        while not self._stopped():
            if not sent:
                self._link.send(datagram)
            sent = False
            answer = self._answer_until(time_us, wall_s() + resend_s)
            if answer is not None:
                self.has_answered = True
                return answer
            waited_s += resend_s
            if waited_s > timeout_s:
                raise AutopilotTimeoutError(self._timeout_message(time_us))
            if self.has_answered:
                resend_s = min(RESEND_MAX_S, RESEND_GROWTH * resend_s)
        return None

    def exchange_until_armed(
        self, datagram: bytes, time_us: int, *, sent: bool = False
    ) -> ActuatorFrame | None:
        """Repeat ``exchange`` until the answer reports an armed vehicle; vehicle time stops."""
        answer = self.exchange(datagram, time_us, sent=sent)
        while answer is not None and not answer.armed:
            time.sleep(FREE_RUN_S)
            answer = self.exchange(datagram, time_us)
        return answer

    def _answer_until(self, time_us: int, deadline_s: float) -> ActuatorFrame | None:
        """Return the answer if it arrives before the deadline; other answers may come first."""
        while (remaining_s := deadline_s - wall_s()) > 0.0:
            answer = self._link.answer(time_us, remaining_s)
            if answer is not None:
                return answer
        return None

    def _timeout_message(self, time_us: int) -> str:
        """Return the error message of a timeout at vehicle time ``time_us``."""
        if self.has_answered:
            return f"the autopilot stopped answering at vehicle time {time_us * 1e-6:.2f} s"
        return (
            f"no autopilot has answered on {self._link.address} for {FIRST_ANSWER_TIMEOUT_S:.0f} s"
        )
