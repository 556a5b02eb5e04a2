"""Supervision: a parent process restarts the autopilot when it has ended or does not respond.

The parent has imported the autopilot's code and forks for each start, so that a restart takes
milliseconds. It does nothing else: no link, no file, no thread.
"""

import os
import select
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple, NoReturn

from mavlink_io.clock import Interval, wall_s
from mavlink_io.errors import BAD_INPUT
from mavlink_io.parent_watch import END_SIGNALS, on_end_signals

BEAT_S = 0.1
"""Interval of the signs of life of the autopilot."""
STALL_S, STALL_GRACE_S = 1.0, 0.2
"""Time without a sign of life after which the autopilot is killed and started again.

The grace follows a machine that was paused: the parent may run first."""
START_S = 15.0
"""Longest time until the first sign of life: links are opened and stored parameters loaded."""
FINISH_S = 15.0
"""Longest time from an end signal until the autopilot has finished its logs."""
MIN_RUN_S = 5.0
"""Run time below which an end counts as a failed start."""
FAILED_STARTS = 3
"""Number of failed starts in a row after which the dive is not continued but ended.

The stored state itself may be what ends the autopilot: it then starts with a new state, armed, in
mode SURFACE."""
PAUSE_S = 0.5
"""Pause before a start after ``FAILED_STARTS``."""


class ProcessStart(NamedTuple):
    """What the autopilot has to know of its start."""

    beat: "Beat"
    restarts: int
    """Number of starts before this one."""
    failed_starts: int
    """Number of consecutive starts before this one that ended within `MIN_RUN_S`."""

    @property
    def may_continue(self) -> bool:
        """Whether the stored state may be continued."""
        return self.failed_starts < FAILED_STARTS


class Beat:
    """Sends signs of life to the supervisor."""

    def __init__(self, pipe: int) -> None:
        os.set_blocking(pipe, False)
        self._pipe, self._due = pipe, Interval(BEAT_S)
        self.orphaned = False
        """Whether the supervisor has ended: the autopilot then ends, and can be continued."""

    def __call__(self) -> None:
        """Send a sign of life when it is due."""
        if self._due.due():
            try:
                os.write(self._pipe, b".")
            except BlockingIOError:  # a stopped supervisor does not read
                pass
            except BrokenPipeError:
                self.orphaned = True


def supervise(run: Callable[[ProcessStart], None]) -> NoReturn:
    """Run the autopilot until it ends by itself or by an end signal, and start it again otherwise.

    Parameters
    ----------
    run : callable
        Flies until an end signal. It is called in a child process.
    """
    end_signals: list[int] = []
    on_end_signals(lambda number, _: end_signals.append(number))
    failed_starts = restarts = 0
    while True:
        began_s = wall_s()
        child, pipe = _fork(run, restarts, failed_starts)
        status, reason = _watch(child, pipe, end_signals)
        os.close(pipe)
        if end_signals or status == 0 or (status == BAD_INPUT and restarts == 0):
            sys.exit(status)
        failed_starts = 0 if wall_s() - began_s >= MIN_RUN_S else failed_starts + 1
        restarts += 1
        with suppress(OSError, ValueError):
            print(f"autopilot: {reason}: started again", file=sys.stderr, flush=True)
        if failed_starts >= FAILED_STARTS:
            time.sleep(PAUSE_S)


def _fork(
    run: Callable[[ProcessStart], None], restarts: int, failed_starts: int
) -> tuple[int, int]:
    """Start a child that runs the autopilot; return its process id and the pipe of its beats."""
    reading, writing = os.pipe()
    signal.pthread_sigmask(signal.SIG_BLOCK, END_SIGNALS)
    child = os.fork()
    if child:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, END_SIGNALS)
        os.close(writing)
        return child, reading
    status = 1
    try:
        on_end_signals(signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, END_SIGNALS)
        os.close(reading)
        run(ProcessStart(Beat(writing), restarts, failed_starts))
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        with suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def _watch(child: int, pipe: int, end_signals: list[int]) -> tuple[int, str]:
    """Wait until the child has ended, or kill it; return its exit status and the reason."""
    poller = select.poll()
    poller.register(pipe, select.POLLIN | select.POLLHUP)
    forwarded, deadline_s = False, wall_s() + START_S
    while True:
        if end_signals and not forwarded:
            forwarded, deadline_s = True, wall_s() + FINISH_S
            os.kill(child, end_signals[0])
        if poller.poll(BEAT_S * 1000.0):
            if not os.read(pipe, 4096):
                return _exit_status(child)
            if not forwarded:
                deadline_s = wall_s() + STALL_S
        elif wall_s() > deadline_s and not poller.poll(STALL_GRACE_S * 1000.0):
            os.kill(child, signal.SIGKILL)
            _exit_status(child)
            return 1, "did not respond and was killed"


def _exit_status(child: int) -> tuple[int, str]:
    """Wait for the end of a child; return its exit status and a text."""
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status < 0:
        return 1, f"ended by {signal.Signals(-status).name}"
    return status, f"ended with status {status}"
