"""Real processes for tests: an autopilot, a simulator and third-party programs."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from ground.simulation import affinity
from ground.simulation.processes import free_port as free_port

TIMEOUT_S = 60.0
REAL_TIME_NICENESS, BACKGROUND_NICENESS = -5, 5
"""Niceness for three times and a third of the processor time of a normal program (sched(7)).

Programs that must follow the wall clock come first; programs in lockstep wait for each other."""

READS_PROC = pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="reads processes from /proc"
)


def wait_for(condition: Callable[[], object]) -> None:
    """Wait until a condition is met; fail after TIMEOUT_S."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def run_python(*arguments: str, folder: Path) -> str:
    """Run Python in a folder and return its output."""
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, (arguments, done.stdout[-2000:], done.stderr[-2000:])
    return done.stdout


def is_running(pid: int) -> bool:
    """Return whether a process has not ended; one that nobody waited for has."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rsplit(")", 1)[1].split()[0] != "Z"


class Finished(NamedTuple):
    status: int
    stdout: str
    stderr: str


class Process:
    """A child process whose output is read after its end."""

    def __init__(
        self,
        *arguments: str,
        executable: str = sys.executable,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self._popen = subprocess.Popen(
            [executable, *arguments],
            env=None if environment is None else {**os.environ, **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    @property
    def running(self) -> bool:
        return self._popen.poll() is None

    @property
    def pid(self) -> int:
        return self._popen.pid

    def wait_for_line(self) -> str:
        """Return the next line on stderr, which a process prints when it is ready."""
        assert self._popen.stderr is not None
        return self._popen.stderr.readline()

    def write_line(self, line: str) -> None:
        """Write a line to its standard input."""
        assert self._popen.stdin is not None
        self._popen.stdin.write(line + "\n")
        self._popen.stdin.flush()

    def read_until(self, pattern: str) -> re.Match[str]:
        """Read stdout up to the first line that matches."""
        assert self._popen.stdout is not None
        output = []
        for line in self._popen.stdout:
            output.append(line)
            if match := re.search(pattern, line):
                return match
        raise AssertionError(f"{pattern!r} is not in:\n{''.join(output)}")

    def pin(self, core: int) -> None:
        """Restrict the process to one core."""
        affinity.pin(self._popen.pid, core)

    def set_niceness(self, niceness: int) -> None:
        """Set the priority, as nice(1). A negative value has no effect without permission."""
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, self._popen.pid, niceness)

    def signal(self, number: signal.Signals) -> None:
        self._popen.send_signal(number)

    def finish(self, text: str = "", timeout_s: float = TIMEOUT_S) -> Finished:
        """Write the rest of its input and wait for its end."""
        stdout, stderr = self._popen.communicate(text, timeout=timeout_s)
        return Finished(self._popen.returncode, stdout, stderr)

    def kill(self) -> None:
        if self.running:
            self._popen.kill()
        self._popen.communicate()


@contextlib.contextmanager
def process(
    *arguments: str,
    executable: str = sys.executable,
    environment: Mapping[str, str] | None = None,
) -> Iterator[Process]:
    """Start a process that ends with the test at the latest; ``environment`` is added to ours."""
    child = Process(*arguments, executable=executable, environment=environment)
    try:
        yield child
    finally:
        child.kill()


@contextlib.contextmanager
def autopilot(hil: str, *ground: str, options: tuple[str, ...] = ()) -> Iterator[Process]:
    """Start an autopilot and wait until it is ready.

    Without other options it starts with no stored state.
    """
    links = [word for address in ground for word in ("--gcs", address)]
    with process(
        "-m", "autopilot", "--hil", hil, *links, "--state", "off", "--logs", "off", *options
    ) as child:
        line = child.wait_for_line()
        assert line.startswith("autopilot: system"), line
        yield child


@contextlib.contextmanager
def on_one_core(*programs: Process) -> Iterator[None]:
    """Restrict the autopilot and the simulator of a vehicle to one core, as ground does."""
    core = affinity.take_core()
    if core is None:
        yield
        return
    for program in programs:
        program.pin(core)
    try:
        yield
    finally:
        affinity.release_core(core)


@contextlib.contextmanager
def vehicle(*ground: str, speed: str = "1", options: tuple[str, ...] = ()) -> Iterator[Process]:
    """Start an autopilot and a simulator with the vehicle at the surface."""
    port = free_port()
    with (
        autopilot(f"udpin:127.0.0.1:{port}", *ground, options=options) as child,
        process(
            "-m", "sitl", "--hil", f"udpout:127.0.0.1:{port}", "--speed", speed, "--seed", "1"
        ) as sea,
        on_one_core(child, sea),
    ):
        yield child
