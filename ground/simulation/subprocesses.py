"""Start processes that end with this one: with a new interpreter, or forked from a preloaded one.

A new interpreter needs one to two seconds of processor time to load its libraries, a forked one a
tenth of that, so campaigns fork. Both kinds get only command-line arguments and share nothing with
this process.
"""

import importlib
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from multiprocessing import forkserver, parent_process
from pathlib import Path
from threading import Event
from typing import Protocol

from ground.simulation import affinity
from mavlink_io import parent_watch
from mavlink_io.errors import OperationError

PRELOADED_MODULES = ("__main__", "autopilot.cli", "autopilot.preload", "sitl.preload")
"""Modules that the fork server loads before it forks. `__main__` is the running command, which
multiprocessing would otherwise load in each child."""
_SOURCES = str(Path(__file__).parents[2])
_fork_server_is_loaded = Event()
"""Set when the fork server has forked a process: it has loaded `PRELOADED_MODULES`."""


class ChildProcess(Protocol):
    """A child process. Its standard input is closed when this process ends."""

    def poll(self) -> int | None:
        """Return the exit status, negative for a signal; None while it runs."""

    def pin(self, core: int) -> None:
        """Restrict the process to a core, if it still runs.

        Parameters
        ----------
        core : int
            Number of the core.
        """

    def terminate(self) -> None:
        """Send SIGTERM."""

    def end(self, within_s: float) -> None:
        """Wait for the end of the process; kill it after a timeout.

        Parameters
        ----------
        within_s : float
            Wall time of the timeout, s.
        """


class ProcessFactory(Protocol):
    """Start `python -m module` with arguments; its standard error is appended to a file."""

    def __call__(self, module: str, arguments: Sequence[str], stderr_file: Path) -> ChildProcess:
        """Return the started process."""


class CommandProcess:
    """A child process that runs a command.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    stderr_file : Path
        File to which its standard error is appended.
    """

    def __init__(self, command: Sequence[str], stderr_file: Path) -> None:
        paths = [_SOURCES, *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        with stderr_file.open("ab") as stderr:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=stderr,
                env=environment,
            )

    def poll(self) -> int | None:
        """Return the exit status, None while the process runs."""
        return self._process.poll()

    def pin(self, core: int) -> None:
        """Restrict the process to a core, if it still runs.

        Parameters
        ----------
        core : int
            Number of the core.
        """
        if self._process.poll() is None:
            affinity.pin(self._process.pid, core)

    def terminate(self) -> None:
        """Send SIGTERM, if the process still runs."""
        if self._process.poll() is None:
            self._process.terminate()

    def end(self, within_s: float) -> None:
        """Wait for the end of the process; kill it after a timeout.

        Parameters
        ----------
        within_s : float
            Wall time of the timeout, s.
        """
        try:
            self._process.wait(within_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()


class SpawnedProcess(CommandProcess):
    """A child process with a new interpreter.

    Parameters
    ----------
    module : str
        Package whose `__main__` runs.
    arguments : sequence of str
        Arguments of its command line.
    stderr_file : Path
        File to which its standard error is appended.
    """

    def __init__(self, module: str, arguments: Sequence[str], stderr_file: Path) -> None:
        super().__init__([sys.executable, "-m", module, *arguments], stderr_file)


def start_fork_server() -> None:
    """Start the process from which `ForkedProcess` forks, which takes a second to load modules."""
    parent_watch.start_fork_server(PRELOADED_MODULES)


def stop_loading_fork_server() -> None:
    """Kill the fork server if it still loads modules; starts that wait for it fail.

    To compile the simulator takes it up to four minutes. A fork server that has loaded is kept:
    without it the exit status of its processes is unknown.
    """
    pid = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    if pid is not None and not _fork_server_is_loaded.is_set():
        os.kill(pid, signal.SIGKILL)


class ForkedProcess:
    """A child forked from a server process that has loaded `PRELOADED_MODULES`.

    The first instance starts the server, unless `start_fork_server` did.

    Parameters
    ----------
    module : str
        Package whose `__main__` runs.
    arguments : sequence of str
        Arguments of its command line.
    stderr_file : Path
        File to which its standard error is appended.

    Raises
    ------
    OperationError
        The server ended before it forked the process.
    """

    def __init__(self, module: str, arguments: Sequence[str], stderr_file: Path) -> None:
        self._process = parent_watch.fork_context(PRELOADED_MODULES).Process(
            target=_run, args=(module, list(arguments), stderr_file), daemon=True
        )
        try:
            self._process.start()
        except (EOFError, ConnectionError):
            raise OperationError(
                f"{module}: the process that loads the programs ended: is there enough memory?"
            ) from None
        _fork_server_is_loaded.set()

    def poll(self) -> int | None:
        """Return the exit status, None while the process runs."""
        return self._process.exitcode

    def pin(self, core: int) -> None:
        """Restrict the process to a core, if it still runs.

        Parameters
        ----------
        core : int
            Number of the core.
        """
        if self._process.pid is not None and self._process.exitcode is None:
            affinity.pin(self._process.pid, core)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._process.terminate()

    def end(self, within_s: float) -> None:
        """Wait for the end of the process; kill it after a timeout.

        Parameters
        ----------
        within_s : float
            Timeout (wall time, s).
        """
        self._process.join(within_s)
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()


def _run(module: str, arguments: list[str], stderr_file: Path) -> None:
    """Run `python -m module` in this forked process."""
    parent = parent_process()
    assert parent is not None
    os.dup2(parent.sentinel, 0)
    with Path(os.devnull).open("wb") as null, stderr_file.open("ab") as stderr:
        os.dup2(null.fileno(), 1)
        os.dup2(stderr.fileno(), 2)
    sys.argv = [module, *arguments]
    importlib.import_module(f"{module}.__main__").main()
