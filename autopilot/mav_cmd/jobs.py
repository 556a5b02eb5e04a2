"""Long jobs: whoever asked hears IN_PROGRESS until they end."""

from collections.abc import Callable
from typing import NamedTuple

from autopilot.mav_cmd.wire import Command, Job, Progress
from autopilot.types import CANCELLED, IN_PROGRESS
from link.exchange import Party

REASSURE_S = 0.4
"""Clients repeat a command that nobody answers after half a second, and give up three seconds after the last word."""

Answer = Callable[[Progress], None]
"""Acknowledges the command to whoever asked."""


class _Open(NamedTuple):
    asker: Party
    command: Command
    look: Job
    answer: Answer
    told_s: float

    def was(self, asker: Party, command: Command) -> bool:
        """Whether these are the words that began it; their NaN must not make them differ."""
        return asker == self.asker and repr(command) == repr(self.command)


class Jobs:
    """Those under way."""

    def __init__(self) -> None:
        self._open: list[_Open] = []

    def begin(self, asker: Party, command: Command, job: Job, answer: Answer, now_s: float) -> None:
        """Follow a job whose beginning was acknowledged just now."""
        self._open.append(_Open(asker, command, job, answer, now_s))

    def progress(self, asker: Party, command: Command) -> Progress | None:
        """How far what was asked for before is; None where it is not under way."""
        seen = next((job.look() for job in self._open if job.was(asker, command)), None)
        return seen if seen is not None and seen.result == IN_PROGRESS else None

    def cancel(self, number: int) -> bool:
        """Tell who asked for a command that it is cancelled; False where none of its kind is under way."""
        found = [job for job in self._open if job.command.number == number]
        self._open = [job for job in self._open if job not in found]
        for job in found:
            job.answer(Progress(CANCELLED))
        return bool(found)

    def poll(self, now_s: float) -> None:
        """Reassure those who wait, and tell them the end."""
        still_open = []
        for job in self._open:
            seen = job.look()
            waits = seen.result == IN_PROGRESS
            due = now_s - job.told_s >= REASSURE_S
            if due or not waits:
                job.answer(seen)
            if waits:
                still_open.append(job._replace(told_s=now_s) if due else job)
        self._open = still_open
