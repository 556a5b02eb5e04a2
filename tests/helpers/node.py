"""Readers of MCAP logs in JavaScript, which this project did not write (tests/node)."""

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest

_SOURCE = Path(__file__).parents[1] / "node"


@cache
def _installed(folder: Path) -> str:
    """Install the packages in a folder and return why that failed, "" if it did not."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        return "node or npm is missing"
    shutil.copytree(_SOURCE, folder, dirs_exist_ok=True)
    command = ["npm", "ci", "--no-audit", "--no-fund", "--fetch-retries=1", "--fetch-timeout=20000"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        return "npm did not finish"
    return "" if done.returncode == 0 else f"npm cannot install: {done.stderr.strip()[-200:]}"


def read_logs(folder: Path, *logs: Path) -> dict[str, Any]:
    """Return profile, number of messages and decoded messages by topic of each log.

    The test is skipped without node or without its packages.
    """
    reason = _installed(folder)
    if reason:
        pytest.skip(reason)
    done = subprocess.run(
        ["node", "read_log.js", *map(str, logs)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    counts: dict[str, Any] = json.loads(done.stdout)
    return counts
