"""End a fork server whose parent ends while it loads modules, as a side effect of the import.

By itself a fork server notices the end of its parent after all modules are loaded, and to compile
the simulator takes a minute. A timer is used because a fork server may have no threads. Forked
children have no timer.
"""

import os
import signal

PERIOD_S = 0.5
"""Wall time between two checks."""
_PARENT = os.getppid()


def _end_without_parent(*_: object) -> None:
    """End this process if its parent has ended."""
    if os.getppid() != _PARENT:
        os._exit(1)


signal.signal(signal.SIGALRM, _end_without_parent)
signal.setitimer(signal.ITIMER_REAL, PERIOD_S, PERIOD_S)
