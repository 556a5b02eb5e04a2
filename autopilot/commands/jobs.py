"""Long jobs: whoever asked hears IN_PROGRESS until they end."""

from collections.abc import Callable
from typing import NamedTuple

from autopilot.commands.types import Job, JobProgress, MavCommand
from autopilot.control.types import CANCELLED, IN_PROGRESS
from mavlink_io.request import MavlinkId

PROGRESS_PERIOD_S = 0.4
"""Clients repeat a command that nobody answers after half a second, and give up three seconds after
the last word."""
REPETITION_TIMEOUT_S = 3.5
"""The longest that clients wait before they repeat: QGroundControl's three seconds."""

AnswerCallback = Callable[[JobProgress], None]
"""Acknowledges the command to whoever asked."""


class _Open(NamedTuple):
    asker: MavlinkId
    command: MavCommand
    look: Job
    answer: AnswerCallback
    told_s: float

    def was(self, asker: MavlinkId, command: MavCommand) -> bool:
        """Whether these are the words that began it; their NaN must not make them differ."""
        return asker == self.asker and repr(command) == repr(self.command)


class _Ended(NamedTuple):
    job: _Open
    result: JobProgress
    ended_s: float


class Jobs:
    """Those under way, and how each sender's last one ended."""

    def __init__(self) -> None:
        self._open: list[_Open] = []
        self._ended: dict[MavlinkId, _Ended] = {}

    def begin(
        self, asker: MavlinkId, command: MavCommand, job: Job, answer: AnswerCallback, now_s: float
    ) -> None:
        """Follow a job whose beginning was acknowledged just now."""
        self._open.append(_Open(asker, command, job, answer, now_s))

    def progress(
        self, asker: MavlinkId, command: MavCommand, repetition: bool, now_s: float
    ) -> JobProgress | None:
        """How far what was asked for before is; None where it is not under way.

        To a ``repetition`` of what has just ended belongs its end: the acknowledgement was lost, or
        is on its way."""
        seen = next((job.look() for job in self._open if job.was(asker, command)), None)
        if seen is not None and seen.result == IN_PROGRESS:
            return seen
        last = self._ended.get(asker)
        if last is None or not repetition or now_s - last.ended_s > REPETITION_TIMEOUT_S:
            return None
        return last.result if last.job.was(asker, command) else None

    def cancel(self, number: int, now_s: float) -> bool:
        """Tell who asked for a command that it is cancelled; False where none of its kind is under
        way."""
        found = [job for job in self._open if job.command.number == number]
        self._open = [job for job in self._open if job not in found]
        for job in found:
            self._end(job, JobProgress(CANCELLED), now_s)
        return bool(found)

    def poll(self, now_s: float) -> None:
        """Reassure those who wait, and tell them the end."""
        still_open = []
        for job in self._open:
            seen = job.look()
            waits = seen.result == IN_PROGRESS
            due = now_s - job.told_s >= PROGRESS_PERIOD_S
            if not waits:
                self._end(job, seen, now_s)
                continue
            if due:
                job.answer(seen)
            still_open.append(job._replace(told_s=now_s) if due else job)
        self._open = still_open

    def _end(self, job: _Open, result: JobProgress, now_s: float) -> None:
        self._ended[job.asker] = _Ended(job, result, now_s)
        job.answer(result)
