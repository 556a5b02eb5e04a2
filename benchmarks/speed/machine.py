"""The machine: description, load, processes that load it, and the cost of child processes."""

import contextlib
import datetime
import importlib.metadata
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from benchmarks.speed.results import Conditions, Machine
from mavlink_io.errors import OperationError
from sysid.trials import usable_cores

ROOT = Path(__file__).parents[2]
"""Folder of the sources."""
WRITTEN = ("docs/performance", "docs/performance.md")
"""Files of the repository that `make bench` writes."""
MIN_WATCH_S = 1.0
"""Shortest wall time over which the use of cores is known: the system counts in steps of 10 ms."""
SPIN = """
import os
parent = os.getppid()
while os.getppid() == parent:
    for _ in range(1_000_000):
        pass
"""
"""Program that computes until its parent has ended."""


class Cost(NamedTuple):
    """Cost of a command."""

    wall_s: float
    cpu_s: float
    """User and system time of the process and of its children that it waited for."""


class ProcessEntry(NamedTuple):
    """One line of the process table."""

    parent: int
    command: str
    cpu_s: float
    ended_cpu_s: float = 0.0
    """Processor time of its children that have ended and that it waited for."""


def describe() -> Machine:
    """Return cores, processor and versions."""
    return Machine(
        cores=usable_cores(),
        cpu=_cpu_model(),
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        numpy=importlib.metadata.version("numpy"),
        numba=importlib.metadata.version("numba"),
    )


def _cpu_model() -> str:
    """Return the processor's name; where the system does not report it, its architecture."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def load() -> float:
    """Return the load average of the last minute."""
    return round(os.getloadavg()[0], 2)


class ProcessorTimes(NamedTuple):
    """Wall time, and processor time of the whole machine and of this program's processes."""

    wall_s: float
    all_s: float | None
    """None if the system does not report it."""
    own_s: float


class Watch:
    """Load of the machine from the construction on."""

    def __init__(self) -> None:
        self._load = load()
        self._began = _processor_times()

    def conditions(self) -> Conditions:
        """Return the conditions of a measurement that ends now."""
        now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        others = other_cores(self._began, _processor_times())
        return Conditions(now, revision(), self._load, load(), others)


def other_cores(began: ProcessorTimes, ended: ProcessorTimes) -> float | None:
    """Return the mean number of cores that other programs used; None if it is unknown."""
    wall_s = ended.wall_s - began.wall_s
    if began.all_s is None or ended.all_s is None or wall_s < MIN_WATCH_S:
        return None
    other_s = (ended.all_s - began.all_s) - (ended.own_s - began.own_s)
    return round(max(0.0, other_s / wall_s), 2)


def _processor_times() -> ProcessorTimes:
    """Return the times so far."""
    tree = descendants(process_table(), os.getpid()).values()
    own_s = sum(entry.cpu_s + entry.ended_cpu_s for entry in tree)
    return ProcessorTimes(time.monotonic(), used_cpu_s(), own_s)


@cache
def revision() -> str:
    """Return the last commit, with "-dirty" if sources differ from it; empty without a repository.

    The results are no sources. They change during a run, so the first answer is kept.
    """
    try:
        commit = _git("rev-parse", "--short", "HEAD")
        changed = _git("status", "--porcelain", "--", ".", *(f":!{path}" for path in WRITTEN))
    except (OSError, subprocess.CalledProcessError):
        return ""
    return commit + ("-dirty" if changed else "")


def _git(*arguments: str) -> str:
    """Return what git prints about the sources."""
    command = ["git", "-C", str(ROOT), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Run processes that compute all the time, on whatever cores the system gives them."""
    command = [sys.executable, "-c", SPIN]
    with contextlib.ExitStack() as stack:
        loops = []
        for _ in range(count):
            loops.append(stack.enter_context(subprocess.Popen(command)))
            stack.callback(loops[-1].kill)
        yield loops


def environment(sources: Path) -> dict[str, str]:
    """Return the environment for a child process that takes the packages from a folder."""
    paths = [str(sources), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def run(
    arguments: Sequence[str],
    *,
    sources: Path = ROOT,
    on_line: Callable[[str], None] | None = None,
) -> Cost:
    """Run Python with arguments and return its cost; `on_line` receives each line that it prints.

    Raises OperationError if it fails.
    """
    began_s, last = time.perf_counter(), ""
    process = subprocess.Popen(
        [sys.executable, *arguments],
        cwd=sources,
        env=environment(sources),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    try:
        assert process.stdout is not None
        with process.stdout:
            for line in process.stdout:
                last = line.strip() or last
                if on_line is not None:
                    on_line(line.rstrip())
        _, status, usage = os.wait4(process.pid, 0)
    except BaseException:
        process.kill()
        process.wait()
        raise
    process.returncode = os.waitstatus_to_exitcode(status)
    cost = Cost(time.perf_counter() - began_s, usage.ru_utime + usage.ru_stime)
    if process.returncode:
        raise OperationError(_failure(arguments, process.returncode, last))
    return cost


def output_of(arguments: Sequence[str], **variables: str) -> str:
    """Return what Python with arguments prints. Raises OperationError if it fails."""
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**environment(ROOT), **variables},
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [""])[-1].strip()
        raise OperationError(_failure(arguments, done.returncode, last))
    return done.stdout


def _failure(arguments: Sequence[str], status: int, last: str) -> str:
    """Return one line about a command that failed, with the last line that it printed."""
    return f"python {' '.join(arguments)}: ended with status {status}" + (last and f": {last}")


def used_cpu_s() -> float | None:
    """Return the processor time of the whole machine since its start; None if it is unknown."""
    with contextlib.suppress(OSError):
        # proc_stat(5): user, nice, system
        ticks = Path("/proc/stat").read_text(encoding="ascii").split(maxsplit=4)[1:4]
        return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
    return None


def process_table() -> Mapping[int, ProcessEntry]:
    """Return all processes by number; empty on a system without /proc."""
    table, tick_s = {}, 1.0 / os.sysconf("SC_CLK_TCK")
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # the process has ended
            # proc_pid_stat(5): the name in parentheses may contain blanks
            fields = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode().strip()
            user, system, ended_user, ended_system = (tick_s * int(n) for n in fields[11:15])
            entry = ProcessEntry(int(fields[1]), command, user + system, ended_user + ended_system)
            table[int(folder.name)] = entry
    return table


def descendants(table: Mapping[int, ProcessEntry], pid: int) -> dict[int, ProcessEntry]:
    """Return a process and all processes below it."""
    found, new = {}, [pid]
    while new:
        number = new.pop()
        if number in table:
            found[number] = table[number]
            new += [child for child, entry in table.items() if entry.parent == number]
    return found


def peak_memory_mb(pid: int) -> float | None:
    """Return the largest resident size of a process so far (MB); None if it is unknown."""
    with contextlib.suppress(OSError):
        return peak_mb(Path(f"/proc/{pid}/status").read_text(encoding="utf-8"))
    return None


def peak_mb(status: str) -> float | None:
    """Return the largest resident size (MB) from the text of /proc/PID/status."""
    sizes = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(sizes[0]) * 1024 / 1e6 if sizes else None
