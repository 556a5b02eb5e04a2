"""Choice of a processor core for each simulated dive.

The two processes of a dive in lockstep take turns: one computes while the other waits. On one core
each can block while it waits, and the operating system switches to the other one. On two cores both
have to poll to answer quickly (`mavlink_io.transport.wait`), which is slow as soon as other
programs need the processor. So both processes of a dive are restricted to the same core. The thread
that records the dive keeps to the cores without a dive, where there are some: woken by telemetry,
it would otherwise run on the core of the dive, and both processes would wait for it.
"""

import contextlib
import os
import secrets
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Lock

SAMPLE_S = 0.05
"""Time over which the load of the cores is measured: five clock ticks of /proc/stat."""
STATISTICS = Path("/proc/stat")
_lock = Lock()
_dives_on: Counter[int] = Counter()
"""Number of this process's dives on each core."""


def cores() -> list[int]:
    """Return the cores that this process may use; empty if the system cannot report them."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []


def take_core() -> int | None:
    """Choose a core for a dive; `release_core` gives it back.

    Candidates are the usable cores with the fewest dives of this process. Among them the core with
    the least load is chosen, at random if several have the same load.

    Returns
    -------
    int or None
        Number of the core; None if the system cannot restrict a process to a core.
    """
    with _lock:
        usable = cores()
        if not usable:
            return None
        fewest = min(_dives_on[core] for core in usable)
        core = _least_loaded([core for core in usable if _dives_on[core] == fewest])
        _dives_on[core] += 1
        return core


def release_core(core: int) -> None:
    """Give back a core that `take_core` returned.

    Parameters
    ----------
    core : int
        Number of the core.
    """
    with _lock:
        _dives_on[core] -= 1


def pin(pid: int, core: int) -> None:
    """Restrict a process to a core, if the system allows it.

    Parameters
    ----------
    pid : int
        Number of the process; 0 is the calling one.
    core : int
        Number of the core.
    """
    with contextlib.suppress(OSError):  # it has ended, or the core is no longer allowed
        os.sched_setaffinity(pid, {core})


@contextlib.contextmanager
def restrict_to_free_cores() -> Iterator[None]:
    """Restrict the calling thread to the cores without a dive, if there are some."""
    usable = cores()
    with _lock:
        free = [core for core in usable if not _dives_on[core]]
    if not free or free == usable:
        yield
        return
    os.sched_setaffinity(0, free)
    try:
        yield
    finally:
        os.sched_setaffinity(0, usable)


def idle_ticks(statistics: str) -> dict[int, int]:
    """Return the idle time of each core from the text of /proc/stat, in clock ticks."""
    rows = [line.split() for line in statistics.splitlines() if line.startswith("cpu")]
    # columns: name, user, nice, system, idle, iowait (proc_stat(5)); the first row is the sum
    return {int(row[0][3:]): int(row[4]) + int(row[5]) for row in rows if row[0] != "cpu"}


def _least_loaded(candidates: Sequence[int]) -> int:
    """Return the core with the most idle time during `SAMPLE_S`."""
    if len(candidates) == 1:
        return candidates[0]
    before = _read_idle_ticks()
    time.sleep(SAMPLE_S)
    after = _read_idle_ticks()
    idle = {core: after.get(core, 0) - before.get(core, 0) for core in candidates}
    most = max(idle.values())
    return secrets.choice([core for core in candidates if idle[core] == most])


def _read_idle_ticks() -> dict[int, int]:
    """Return the idle time of each core; empty if the system does not report it."""
    try:
        return idle_ticks(STATISTICS.read_text(encoding="ascii"))
    except (OSError, ValueError, IndexError):
        return {}
