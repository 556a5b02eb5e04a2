"""`autopilot` in an environment that has only the packages of requirements/vehicle.lock."""

import os
import re
import subprocess
import sys
import venv
from contextlib import closing
from importlib.metadata import distribution
from pathlib import Path

import pytest

from tests.helpers.fake_hil import TICK_US
from tests.helpers.subprocesses import free_port
from tests.processes.test_autopilot import Simulator

pytestmark = pytest.mark.process

ROOT = Path(__file__).parents[2]
PACKAGES = ("autopilot", "mavlink_io")
"""First-party packages that the vehicle needs."""
MAX_BYTES = 100e6


def pinned(lock: str) -> dict[str, str]:
    text = (ROOT / "requirements" / lock).read_text(encoding="utf-8")
    return dict(re.findall(r"^([\w.-]+)==(\S+)", text, re.M))


def files_of(name: str) -> list[Path]:
    """Return the installed files of a distribution, without compiled copies and programs."""
    files = [Path(str(file.locate())) for file in distribution(name).files or ()]
    return [file for file in files if file.suffix != ".pyc" and ".." not in file.parts]


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The environment of `make vehicle`, made of links to the packages that are installed here."""
    folder = tmp_path_factory.mktemp("vehicle")
    venv.create(folder, with_pip=False, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for name in pinned("vehicle.lock"):
        tops = {Path(file).parts[0] for file in map(str, distribution(name).files or ())}
        for top in tops - {"..", "__pycache__"}:
            target = Path(str(distribution(name).locate_file(top)))
            if not (packages / top).exists():
                (packages / top).symlink_to(target)
    for name in PACKAGES:
        (packages / name).symlink_to(ROOT / name)
    (metadata,) = {
        Path(str(distribution("caribou-auv").locate_file(file.parts[0])))
        for file in distribution("caribou-auv").files or ()
        if file.parts[0].endswith(".dist-info")
    }
    (packages / metadata.name).symlink_to(metadata)
    return folder


def run(environment: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a program of the environment outside the checkout, without this process's paths."""
    clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.Popen(
        [environment / "bin" / "python", *arguments],
        cwd=environment,
        env=clean,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_vehicle_environment_flies_hil(environment: Path) -> None:
    hil = free_port()
    arguments = ("--hil", f"udpin:127.0.0.1:{hil}", "--state", "off", "--logs", "off")
    with run(environment, "-m", "autopilot", *arguments) as autopilot:
        try:
            assert autopilot.stderr is not None
            assert autopilot.stderr.readline().startswith("autopilot: system 1")
            with closing(Simulator(hil)) as simulator:
                for tick in range(50):
                    assert simulator.ask(tick * TICK_US).time_usec == tick * TICK_US
        finally:
            autopilot.kill()


def test_vehicle_environment_prints_help(environment: Path) -> None:
    with run(environment, "-m", "autopilot", "--help") as autopilot:
        text, problem = autopilot.communicate(timeout=60)
    assert (autopilot.returncode, problem) == (0, "")
    assert "--hil" in text


@pytest.mark.parametrize("absent", ["numpy", "scipy", "numba", "sitl", "sysid", "ground"])
def test_vehicle_environment_lacks_what_it_does_not_need(environment: Path, absent: str) -> None:
    with run(environment, "-c", f"import {absent}") as attempt:
        assert "ModuleNotFoundError" in attempt.communicate(timeout=60)[1]


def test_vehicle_lock_agrees_with_run_lock() -> None:
    whole = pinned("run.lock")
    assert {name: whole[name] for name in pinned("vehicle.lock")} == pinned("vehicle.lock")


def test_vehicle_packages_are_small() -> None:
    sizes = {
        name: sum(file.stat().st_size for file in files_of(name) if file.exists())
        for name in pinned("vehicle.lock")
    }
    assert sum(sizes.values()) <= MAX_BYTES, (sizes, sys.version)
