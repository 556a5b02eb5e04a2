"""Programs in JavaScript with packages that this project did not write (tests/node)."""

import fcntl
import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest

_SOURCE = Path(__file__).parents[1] / "node"
MAVLINK_FOLDER = Path(__file__).parents[2] / "build" / "node-mavlink"
"""Where the program with node-mavlink is installed; several test processes share it."""


@cache
def installation_failure(source: Path, folder: Path) -> str:
    """Install a program with its packages in a folder; return why that failed, else "".

    Packages that are installed from the same lock file stay.
    """
    if shutil.which("node") is None or shutil.which("npm") is None:
        return "node or npm is missing"
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return _install(source, folder)


def _install(source: Path, folder: Path) -> str:
    """Copy a program, and install its packages unless they are there."""
    wanted, stamp = (source / "package-lock.json").read_text("utf-8"), folder / "installed"
    for path in (path for path in source.iterdir() if path.is_file()):
        shutil.copy(path, folder)
    if stamp.exists() and stamp.read_text("utf-8") == wanted:
        return ""
    command = ["npm", "ci", "--no-audit", "--no-fund", "--fetch-retries=1", "--fetch-timeout=20000"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        return "npm did not finish"
    if done.returncode != 0:
        return f"npm cannot install: {done.stderr.strip()[-200:]}"
    stamp.write_text(wanted, "utf-8")
    return ""


def mavlink_failure() -> str:
    """Install the program with node-mavlink; return why that failed, else ""."""
    return installation_failure(_SOURCE / "mavlink", MAVLINK_FOLDER)


def read_logs(folder: Path, *logs: Path) -> dict[str, Any]:
    """Return profile, number of messages and decoded messages by topic of each log.

    The test is skipped without node or without its packages.
    """
    reason = installation_failure(_SOURCE, folder)
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
