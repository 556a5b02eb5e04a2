"""End a process on a signal, or when the process that started it has ended."""

import os
import signal
from collections.abc import Callable
from threading import Thread
from types import FrameType

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a program after it has finished its logs: Ctrl-C, kill, a closed terminal."""


def on_end_signals(
    handler: Callable[[int, FrameType | None], object] | signal.Handlers,
) -> None:
    """Call a handler for each of ``END_SIGNALS``; an ignored SIGHUP stays ignored (``nohup``).

    Parameters
    ----------
    handler : callable or signal.Handlers
        Signal handler as of ``signal.signal``. It may take no lock, as `Event.set` does: a second
        signal that interrupts it would wait for that lock for ever.
    """
    for number in END_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def start_fork_server() -> None:
    """Start the fork server of `multiprocessing`, without the signals of this process.

    It loads modules before it ignores Ctrl-C by itself, and would print a traceback.
    """
    from multiprocessing import forkserver

    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_stdin() -> None:
    """Raise SIGTERM in this process when its standard input ends: its parent has then ended."""
    Thread(target=_raise_sigterm_at_end_of_stdin, name="parent-watch", daemon=True).start()


def _raise_sigterm_at_end_of_stdin() -> None:
    """Read standard input to its end, then raise SIGTERM."""
    while os.read(0, 1024):
        pass
    signal.raise_signal(signal.SIGTERM)
