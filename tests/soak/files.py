"""Soak row: hostile files for each reader."""

import random
import resource
import signal
import tempfile
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from tests.fuzz.files import FILES, seeds_of
from tests.fuzz.mutate import mutated
from tests.soak.row import Batch, Row

HANG_S = 10
"""Requirement: longest time that a reader may take, in s."""
MAX_RESIDENT_MB = 500.0
"""Requirement: largest resident memory of the process."""


class _HangError(BaseException):
    """A reader takes longer than `HANG_S`."""


def _interrupt(*_: object) -> None:
    """End a reader that hangs."""
    raise _HangError


@cache
def _seeds(name: str) -> list[bytes]:
    """Return valid files of a target."""
    return seeds_of(name)


def run(first: int, count: int) -> Batch:
    """Read mutated files; each case is one file for each reader."""
    batch = Batch()
    shared = Path("/dev/shm")
    previous = signal.signal(signal.SIGALRM, _interrupt)
    try:
        with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as folder:
            for case in range(first, first + count):
                for name in FILES:
                    _read(batch, name, case, Path(folder))
    finally:
        signal.signal(signal.SIGALRM, previous)
    batch.add("max resident MB", _peak_resident_mb())
    return batch


def _peak_resident_mb() -> float:
    """Return the largest resident memory of this program so far.

    `ru_maxrss` also holds the peak of the process that started this one, so it is used only where
    the kernel tells no other number.
    """
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
    return float(line.split()[1]) / 1e3


def _read(batch: Batch, name: str, case: int, folder: Path) -> None:
    """Read one mutated file."""
    target, rng = FILES[name], random.Random(f"{name} {case}")
    data = mutated(rng, rng.choice(_seeds(name)))
    batch.add("files")
    for attempt in range(2):  # a machine that pauses all programs does not pause twice
        began_s = time.monotonic()
        signal.alarm(HANG_S)
        try:
            batch.add("accepted", target.run(data, folder / f"file{target.suffix}"))
        except _HangError:
            if attempt == 1:
                batch.fail(case, f"{name}: no answer in {HANG_S} s")
            continue
        except (AssertionError, MemoryError) as error:
            batch.fail(case, f"{name}: {type(error).__name__}: {error}")
        finally:
            signal.alarm(0)
        batch.add("max s", time.monotonic() - began_s)
        return


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    return (
        f"{counts.get('files', 0):.0f} files for {len(FILES)} readers,"
        f" {counts.get('failures', 0):.0f} tracebacks or hangs; slowest"
        f" {counts.get('max s', 0):.2f} s, {counts.get('max resident MB', 0):.0f} MB resident"
    )


ROW = Row(
    title="hostile files, each reader",
    full_size=100_000,
    batch_size=50,
    run=run,
    describe=describe,
    holds=lambda counts: (
        not counts.get("failures") and counts.get("max resident MB", 0.0) <= MAX_RESIDENT_MB
    ),
    requirement="0 tracebacks, 0 hangs over 10 s, at most 500 MB",
)
