"""Long-running commands: the requester receives IN_PROGRESS until they end."""

from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from autopilot.commands.types import Job, JobProgress, MavCommand
from autopilot.control.types import CANCELLED, IN_PROGRESS
from mavlink_io.request import MavlinkId

PROGRESS_PERIOD_S = 0.4
"""Interval of IN_PROGRESS.

Clients repeat a command after 0.5 s without an acknowledgement, and give up 3 s after the last."""
REPETITION_TIMEOUT_S = 3.5
"""Time after the end of a job in which a repetition gets its result; QGroundControl waits 3 s."""

MAX_OPEN_JOBS = 16
"""Maximum number of jobs in progress; a further one ends the oldest of the requester with most jobs
as cancelled, so that a flood of one requester ends none of the others.

A job lasts until the vehicle has finished it; the vehicle runs one of each kind."""

AnswerCallback = Callable[[JobProgress], None]
"""Function that acknowledges the command to its requester."""


class _OpenJob(NamedTuple):
    """A job in progress."""

    requester: MavlinkId
    command: MavCommand
    read_progress: Job
    answer: AnswerCallback
    acknowledged_s: float

    def matches(self, requester: MavlinkId, command: MavCommand) -> bool:
        """Return whether the command began this job; NaN parameters compare as equal."""
        return requester == self.requester and repr(command) == repr(self.command)


class _EndedJob(NamedTuple):
    """A job with its result."""

    job: _OpenJob
    result: JobProgress
    ended_s: float


class Jobs:
    """Jobs in progress, and the result of the last job of each requester."""

    def __init__(self) -> None:
        self._open: list[_OpenJob] = []
        self._ended: dict[MavlinkId, _EndedJob] = {}

    def begin(
        self,
        requester: MavlinkId,
        command: MavCommand,
        job: Job,
        answer: AnswerCallback,
        now_s: float,
    ) -> None:
        """Add a job whose start was acknowledged at ``now_s``."""
        if len(self._open) >= MAX_OPEN_JOBS:
            counts = Counter(job.requester for job in self._open)
            oldest = max(self._open, key=lambda job: counts[job.requester])  # the first of equals
            self._open.remove(oldest)
            self._end(oldest, JobProgress(CANCELLED), now_s)
        self._open.append(
            _OpenJob(
                requester=requester,
                command=command,
                read_progress=job,
                answer=answer,
                acknowledged_s=now_s,
            )
        )

    def progress(
        self, requester: MavlinkId, command: MavCommand, repetition: bool, now_s: float
    ) -> JobProgress | None:
        """Return the progress of the job that a command has begun; None without such a job.

        A ``repetition`` of a job that ended recently gets its result: its acknowledgement may be
        lost.
        """
        progress = next(
            (job.read_progress() for job in self._open if job.matches(requester, command)), None
        )
        if progress is not None and progress.result == IN_PROGRESS:
            return progress
        last = self._ended.get(requester)
        if last is None or not repetition or now_s - last.ended_s > REPETITION_TIMEOUT_S:
            return None
        return last.result if last.job.matches(requester, command) else None

    def cancel(self, number: int, now_s: float) -> bool:
        """End all jobs of a command as cancelled; return whether there was one."""
        cancelled = [job for job in self._open if job.command.number == number]
        self._open = [job for job in self._open if job not in cancelled]
        for job in cancelled:
            self._end(job, JobProgress(CANCELLED), now_s)
        return bool(cancelled)

    def poll(self, now_s: float) -> None:
        """Acknowledge progress at PROGRESS_PERIOD_S, and the end of jobs."""
        still_open = []
        for job in self._open:
            progress = job.read_progress()
            due = now_s - job.acknowledged_s >= PROGRESS_PERIOD_S
            if progress.result != IN_PROGRESS:
                self._end(job, progress, now_s)
                continue
            if due:
                job.answer(progress)
            still_open.append(job._replace(acknowledged_s=now_s) if due else job)
        self._open = still_open
        self._ended = {
            requester: ended
            for requester, ended in self._ended.items()
            if now_s - ended.ended_s <= REPETITION_TIMEOUT_S
        }

    def _end(self, job: _OpenJob, result: JobProgress, now_s: float) -> None:
        """Record and acknowledge the result of a job."""
        self._ended[job.requester] = _EndedJob(job, result, now_s)
        job.answer(result)
