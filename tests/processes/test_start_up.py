"""Start of the programs: help is light, and Ctrl-C while they load leaves no traceback."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

HEAVY = ("numpy", "scipy", "numba", "matplotlib", "control")
PROGRAM = """
import runpy, sys
sys.argv = [{name!r}, "--help"]
try:
    runpy.run_module({name!r}, run_name="__main__")
except SystemExit as end:
    assert not end.code
print("loaded", *[name for name in {heavy!r} if name in sys.modules])
"""


@pytest.mark.parametrize("name", ["ground", "sitl", "autopilot"])
def test_help_loads_no_numeric_library(name: str) -> None:
    program = PROGRAM.format(name=name, heavy=HEAVY)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert "Usage" in done.stdout
    assert done.stdout.splitlines()[-1].strip() == "loaded"


UNUSED_IN_REFIT = ("matplotlib", "control", "scipy.signal", "scipy.stats", "scipy.ndimage")
"""Libraries whose import takes as long as a fit; a refit does without them."""


def test_refit_loads_no_library_that_it_does_not_use() -> None:
    program = (
        "import sys, ground.campaign.refit;"
        f"print('loaded', *[name for name in {UNUSED_IN_REFIT!r} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "loaded"


@pytest.mark.parametrize(
    ("name", "library"),
    [
        ("ground", "typer"),
        ("sitl", "typer"),
        ("autopilot", "typer"),
        ("ground.compile_kernels", "numpy"),
    ],
)
def test_interrupt_while_modules_load_prints_nothing(
    name: str, library: str, tmp_path: Path
) -> None:
    """The stand-in for a library that the program loads blocks, so that the signal comes then."""
    (tmp_path / f"{library}.py").write_text("import time\nprint(1, flush=True)\ntime.sleep(60.0)\n")
    with subprocess.Popen(
        [sys.executable, "-m", name],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as program:
        assert program.stdout is not None
        program.stdout.readline()
        program.send_signal(signal.SIGINT)
        assert program.communicate(timeout=30.0) == ("", "")
    assert program.returncode == -signal.SIGINT
