"""Processes that end with their parent, also when it is killed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.subprocesses import READS_PROC, is_running, wait_for

SLOW_MODULE = """
import os, time
print(os.getpid(), flush=True)
def work() -> None:
    time.sleep(60.0)
if __name__ == "slow_module" and {at_import}:
    work()
"""
FORK_SERVER = """
import time
from mavlink_io.parent_watch import start_fork_server

if __name__ == "__main__":
    start_fork_server(["slow_module"])
    time.sleep(60.0)
"""
WORKER = """
from ground.campaign.worker import Worker
import slow_module

if __name__ == "__main__":
    Worker(["slow_module"]).call(slow_module.work)
"""


@READS_PROC
@pytest.mark.parametrize(("script", "at_import"), [(FORK_SERVER, True), (WORKER, False)])
def test_busy_process_ends_with_killed_parent(script: str, at_import: bool, tmp_path: Path) -> None:
    """A fork server that loads modules, and a worker that computes."""
    (tmp_path / "slow_module.py").write_text(SLOW_MODULE.format(at_import=at_import))
    (tmp_path / "parent.py").write_text(script)
    command = [sys.executable, str(tmp_path / "parent.py")]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as parent:
        assert parent.stdout is not None
        pid = next(pid for line in parent.stdout if (pid := int(line)) != parent.pid)
        parent.kill()
    wait_for(lambda: not is_running(pid))
