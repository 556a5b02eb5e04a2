"""End a process on a signal, or when the process that started it has ended."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Sequence
from threading import Thread
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # to load it takes as long as the rest of a small program
    from multiprocessing.context import ForkServerContext

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


def fork_context(modules: Sequence[str]) -> ForkServerContext:
    """Return the context of `multiprocessing` whose fork server loads modules before it forks.

    The server ends with this process, also while it loads them.

    Parameters
    ----------
    modules : sequence of str
        Names of the modules.

    Returns
    -------
    ForkServerContext
        Context whose processes are forked from the server.
    """
    from multiprocessing import get_context

    context = get_context("forkserver")
    context.set_forkserver_preload(["mavlink_io.fork_server_watch", *modules])
    return context


def start_fork_server(modules: Sequence[str]) -> ForkServerContext:
    """Start the fork server of `multiprocessing`, without the signals of this process.

    It loads modules before it ignores Ctrl-C by itself, and would print a traceback.

    Parameters
    ----------
    modules : sequence of str
        Names of the modules that it loads before it forks.

    Returns
    -------
    ForkServerContext
        Context whose processes are forked from the server.
    """
    from multiprocessing import forkserver

    context = fork_context(modules)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return context


def end_with_stdin() -> None:
    """Raise SIGTERM in this process when its standard input ends: its parent has then ended."""
    Thread(target=_raise_sigterm_at_end_of_stdin, name="parent-watch", daemon=True).start()


def _raise_sigterm_at_end_of_stdin() -> None:
    """Read standard input to its end, then raise SIGTERM."""
    while os.read(0, 1024):
        pass
    signal.raise_signal(signal.SIGTERM)


def end_with_parent() -> None:
    """End this process of `multiprocessing` at once when its parent has ended."""
    Thread(target=_exit_at_end_of_parent, name="parent-watch", daemon=True).start()


def _exit_at_end_of_parent() -> None:
    """Wait for the end of the parent, then exit."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
