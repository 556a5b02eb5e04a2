"""Programs that are interrupted while the simulator loads or compiles."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

TIMEOUT_S = 60.0
"""Wall time in which the command must load its libraries and end."""
SLOW_MODULE = """
import sys, time
print("loading", file=sys.stderr, flush=True)
time.sleep(600.0)  # longer than any compilation
"""
SERVER_LINES = ("loading\n", "starting\n")
"""Lines of processes that the campaign was about to start when the signal came."""
CAMPAIGN = """
import sys, time
from ground.campaign import dives
from ground.simulation import subprocesses

def start_after_signal(*arguments):
    print("starting", file=sys.stderr, flush=True)
    time.sleep(1.0)
    return subprocesses.ForkedProcess(*arguments)

if __name__ == "__main__":
    subprocesses.PRELOADED_MODULES = ("slow_module",)
    if sys.argv[2] == "starting":
        dives.ForkedProcess = start_after_signal
    from ground.__main__ import main

    sys.argv = ["ground", "campaign", "--jobs", "2", "--out", sys.argv[1]]
    main()
"""

COMPILE = """
from ground.simulation import subprocesses

if __name__ == "__main__":
    subprocesses.PRELOADED_MODULES = ("slow_module",)
    from ground import compile_kernels

    compile_kernels.main()
"""


def start(program: str, folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a program whose fork server loads the slow module."""
    (folder / "slow_module.py").write_text(SLOW_MODULE)
    script = folder / "interrupted.py"
    script.write_text(program)
    sources = os.pathsep.join([str(folder), str(Path(__file__).parents[3])])
    return subprocess.Popen(
        [sys.executable, str(script), *arguments],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": sources},
    )


@pytest.mark.process
@pytest.mark.timeout(2 * TIMEOUT_S)
@pytest.mark.parametrize("moment", ["trims", "starting"])
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 1)])
def test_campaign_signal_while_simulator_loads_ends_it(
    moment: str, number: signal.Signals, status: int, tmp_path: Path
) -> None:
    with start(CAMPAIGN, tmp_path, str(tmp_path / "out"), moment) as campaign:
        assert campaign.stderr is not None
        lines = list[str]()
        while "loading\n" not in lines or not any(moment in line for line in lines):
            lines.append(campaign.stderr.readline())
            assert lines[-1], "the campaign ended"
        campaign.send_signal(number)
        rest = campaign.stderr.read()  # also the fork server has closed it
        assert campaign.wait(TIMEOUT_S) == status
    rest = "".join(line for line in rest.splitlines(keepends=True) if line not in SERVER_LINES)
    assert rest == "ground: interrupted; what was written is kept\n"


@pytest.mark.process
@pytest.mark.timeout(2 * TIMEOUT_S)
def test_compile_kernels_signal_while_simulator_loads_ends_it(tmp_path: Path) -> None:
    """It waited for the compilation of the simulator, up to four minutes, and for the dives."""
    with start(COMPILE, tmp_path) as program:
        assert program.stderr is not None
        assert program.stderr.readline() == "loading\n"
        program.send_signal(signal.SIGINT)
        rest = program.stderr.read()
        assert program.wait(TIMEOUT_S) == 130
    assert rest.replace("loading\n", "") == ""
