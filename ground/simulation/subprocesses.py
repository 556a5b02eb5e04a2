"""Two ways to start a process that ends with this one: as a new interpreter, or forked from one
that is warm.

A new one takes one or two seconds of processor time to load its libraries, a forked one a tenth;
what takes many dives forks. Either is a process of its own, which learns nothing but its arguments
and shares nothing but MAVLink."""

import importlib
import os
import subprocess
import sys
from collections.abc import Sequence
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Protocol

from ground.simulation import affinity

PRELOADED_MODULES = ("__main__", "autopilot.__main__", "sitl.preload")
"""What a process is loaded with before others are forked from it. ``__main__`` is the command under
way, which multiprocessing would otherwise load in each of them."""
_SOURCES = str(Path(__file__).parents[2])


class ChildProcess(Protocol):
    """A process that was started. Its standard input ends when this process does."""

    def poll(self) -> int | None:
        """Its exit status, negative for a signal; None while it runs."""

    def pin(self, core: int) -> None:
        """Restrict it to a core; one that has ended is left alone."""

    def terminate(self) -> None:
        """Ask it to end."""

    def end(self, within_s: float) -> None:
        """Wait until it is gone, and kill it when that takes too long."""


class ProcessFactory(Protocol):
    """Runs ``python -m module`` with ``arguments``; what it says on standard error goes to the file
    ``said``."""

    def __call__(self, module: str, arguments: Sequence[str], said: Path) -> ChildProcess: ...


class SpawnedProcess:
    """A child with an interpreter of its own."""

    def __init__(self, module: str, arguments: Sequence[str], said: Path) -> None:
        paths = [_SOURCES, *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        with said.open("ab") as heard:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=heard,
                env=environment,
            )

    def poll(self) -> int | None:
        return self._process.poll()

    def pin(self, core: int) -> None:
        if self._process.poll() is None:
            affinity.pin(self._process.pid, core)

    def terminate(self) -> None:
        if self._process.poll() is None:
            self._process.terminate()

    def end(self, within_s: float) -> None:
        try:
            self._process.wait(within_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()


class ForkedProcess:
    """A child of a process that has loaded ``PRELOADED_MODULES``, which the first one starts."""

    def __init__(self, module: str, arguments: Sequence[str], said: Path) -> None:
        context = get_context("forkserver")
        context.set_forkserver_preload(list(PRELOADED_MODULES))
        self._process = context.Process(
            target=_run, args=(module, list(arguments), said), daemon=True
        )
        self._process.start()

    def poll(self) -> int | None:
        return self._process.exitcode

    def pin(self, core: int) -> None:
        if self._process.pid is not None and self._process.exitcode is None:
            affinity.pin(self._process.pid, core)

    def terminate(self) -> None:
        self._process.terminate()

    def end(self, within_s: float) -> None:
        self._process.join(within_s)
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()


def _run(module: str, arguments: list[str], said: Path) -> None:
    """Become the process that ``python -m module`` would be."""
    parent = parent_process()
    assert parent is not None
    os.dup2(parent.sentinel, 0)
    with Path(os.devnull).open("wb") as nowhere, said.open("ab") as heard:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(heard.fileno(), 2)
    sys.argv = [module, *arguments]
    importlib.import_module(f"{module}.__main__").main()
