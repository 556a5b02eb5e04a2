"""A process that was started by another ends with it, however that one went."""

import os
import signal
from threading import Thread


def end_with_stdin() -> None:
    """From now on take the end of standard input for a SIGTERM: whoever held its other end is
    gone."""
    Thread(target=_watch, name="lifeline", daemon=True).start()


def _watch() -> None:
    while os.read(0, 1024):
        pass
    signal.raise_signal(signal.SIGTERM)
