"""Spawned and forked child processes: start, error messages and end."""

import importlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from ground.simulation.affinity import cores
from ground.simulation.processes import free_port
from ground.simulation.subprocesses import (
    PRELOADED_MODULES,
    ChildProcess,
    ForkedProcess,
    ProcessFactory,
    SpawnedProcess,
)
from tests.helpers.subprocesses import READS_PROC, is_running, wait_for

PARENT = """
import sys, time
from pathlib import Path
from ground.simulation.subprocesses import ForkedProcess, SpawnedProcess

if __name__ == "__main__":
    child = {start}("autopilot", sys.argv[2:], Path(sys.argv[1]))
    print(child._process.pid, flush=True)
    time.sleep(60.0)
"""


@pytest.fixture(params=[SpawnedProcess, ForkedProcess])
def start(request: pytest.FixtureRequest) -> ProcessFactory:
    way: ProcessFactory = request.param
    return way


@pytest.fixture
def said(tmp_path: Path) -> Path:
    """File of the standard error of a child."""
    path = tmp_path / "said"
    path.touch()
    return path


def arguments() -> list[str]:
    """Return the options of an autopilot without a peer."""
    links = ("--hil", f"udpin:127.0.0.1:{free_port()}", "--gcs", f"udpin:127.0.0.1:{free_port()}")
    return [*links, "--lifeline", "--state", "off", "--logs", "off"]


def afloat(start: ProcessFactory, said: Path) -> ChildProcess:
    """An autopilot that has opened its links."""
    child = start("autopilot", arguments(), said)
    wait_for(lambda: "autopilot: system 1" in said.read_text())
    assert child.poll() is None
    return child


def test_process_terminate_ends_it(start: ProcessFactory, said: Path) -> None:
    child = afloat(start, said)
    child.terminate()
    child.end(10.0)
    assert child.poll() == 0


def test_process_end_kills_after_timeout(start: ProcessFactory, said: Path) -> None:
    child = afloat(start, said)
    child.end(0.1)
    assert child.poll() == -signal.SIGKILL


def test_process_bad_input_status_and_message(start: ProcessFactory, said: Path) -> None:
    child = start("sitl", ["--vehicle", "nobody"], said)
    wait_for(lambda: child.poll() is not None)
    assert child.poll() == 2
    assert said.read_text().splitlines()[-1].startswith("sitl: ")
    assert "nobody" in said.read_text()
    child.end(0.0)


@READS_PROC
@pytest.mark.parametrize("way", ["SpawnedProcess", "ForkedProcess"])
def test_process_ends_with_killed_parent(way: str, said: Path, tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT.format(start=way))
    command = [sys.executable, str(script), str(said), *arguments()]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        wait_for(lambda: "autopilot: system 1" in said.read_text())
        assert is_running(pid)
        parent.kill()
    wait_for(lambda: not is_running(pid))


@pytest.mark.skipif(not cores(), reason="the system does not list its cores")
def test_process_pin_restricts_to_core(start: ProcessFactory, said: Path) -> None:
    core = cores()[-1]
    child = afloat(start, said)
    child.pin(core)
    pid = child._process.pid  # type: ignore[attr-defined]
    assert os.sched_getaffinity(pid) == {core}
    assert cores() == sorted(os.sched_getaffinity(0))
    child.end(0.0)
    child.pin(core)


@pytest.mark.parametrize("module", PRELOADED_MODULES)
def test_preloaded_modules_exist(module: str) -> None:
    """A module that is not would go unnoticed: multiprocessing carries on without it, and starts
    take longer.
    """
    importlib.import_module(module)
