"""When a process has to end: on a signal, and with the process that started it."""

import os
import signal
from collections.abc import Callable
from threading import Thread
from types import FrameType

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, the request to end, and a terminal that closes: each lets a program finish its logs."""


def on_end_signals(handler: Callable[[int, FrameType | None], None]) -> None:
    """Call ``handler`` for each of ``END_SIGNALS``; an ignored SIGHUP stays ignored (``nohup``)."""
    for number in END_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def end_with_stdin() -> None:
    """From now on take the end of standard input for a SIGTERM: whoever held its other end is
    gone."""
    Thread(target=_watch, name="lifeline", daemon=True).start()


def _watch() -> None:
    while os.read(0, 1024):
        pass
    signal.raise_signal(signal.SIGTERM)
