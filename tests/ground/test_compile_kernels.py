"""Compilation of the kernels at installation: a campaign after it compiles nothing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ground import compile_kernels
from mavlink_io.errors import OperationError

REPOSITORY = Path(__file__).parents[2]
PACKAGES = ("mavlink_io", "autopilot", "sitl", "sysid", "ground")


def run_in_copy(copy: Path, *arguments: str) -> str:
    """Run a program of the copied sources; return its standard output."""
    done = subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def compiled_files(copy: Path) -> set[Path]:
    """Return the files of machine code, one for each compiled signature of a kernel."""
    return set(copy.rglob("*.nbc"))


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_campaign_after_compile_kernels_compiles_nothing(tmp_path: Path) -> None:
    copy = tmp_path / "sources"
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(REPOSITORY / package, copy / package, ignore=ignored)
    run_in_copy(copy, "ground.compile_kernels")
    after_installation = compiled_files(copy)
    run_in_copy(copy, "ground", "campaign", "--out", str(tmp_path / "campaign"), "--json")
    assert len(after_installation) > 40
    assert compiled_files(copy) == after_installation


def test_compile_kernels_failed_dive_ends_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(folder: Path) -> None:
        raise OperationError("the autopilot did not listen within 60 s")

    monkeypatch.setattr(compile_kernels, "compile_kernels", fail)
    with pytest.raises(SystemExit) as ended:
        compile_kernels.main()
    assert str(ended.value) == (
        "compile_kernels: the autopilot did not listen within 60 s;"
        " each kernel is compiled at its first use instead"
    )
