"""Every command in the documentation is run by a test.

The tutorials are run as written, in one folder. Then the commands of the other pages are run there,
with the address of a simulated vehicle in place of a serial line. A command counts as run if a
command of the same name with at least its options was run. ELSEWHERE names the tests that run the
others.
"""

import json
import math
import re
import shutil
import signal
import socket
import urllib.request
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from statistics import mean
from typing import NamedTuple

import pytest

from tests.docs.test_site import COMMANDS, PROGRAMS, commands_of
from tests.helpers.docs_blocks import DOCS, ROOT, blocks_of, python_of
from tests.helpers.subprocesses import free_port, process, run_python, vehicle

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.timeout(600)]

TUTORIALS = ("first_flight", "identify_and_redesign", "own_vehicle")
"""Tutorials that run as written; the others need a program that runs until it is stopped."""
NOT_HERE = "ground campaign"
HELPERS = ROOT / "tests" / "helpers" / "subprocesses.py"
"""Options with which all tests start programs."""

FILES = (
    "ground fly first.toml --sitl --live --speed 20 --log live.mcap",
    "ground log info run.mcap",
    "ground log export run.mcap --format mcap",
    "ground log layout foxglove",
    "ground log segments dive1.mcap",
    "ground report before.mcap after.mcap --out both.html",
    "ground replay run.mcap --params gains.param --model model.json",
    "ground redesign model.json --export loops",
    "ground refit dive1.mcap dive2.mcap --prior my_vehicle.toml --compare-method paper",
)
"""Commands that use files of the tutorials, in their order."""
VEHICLE = (
    "ground modes --connect ADDRESS",
    "ground params list --connect ADDRESS",
    "ground params get STN_RADIUS_M --connect ADDRESS --vehicle-id 1",
    "ground params load gains.param --connect ADDRESS",
    "ground params rollback --connect ADDRESS",
    "ground fly first.toml --connect ADDRESS --log second.mcap",
    "ground log list --connect ADDRESS",
    "ground log download --connect ADDRESS",
)
"""Commands that use a vehicle, in their order."""
PROGRAMS_OF_TESTS = (
    "ground campaign --live --out live",
    "sitl --scenario disturbed --speed max --hil ADDRESS --truth truth.mcap --seed 1",
    "sitl --vehicle docs/my_vehicle.toml --scenario swell --seed 7",
    "autopilot --hil ADDRESS --gcs ADDRESS --logs logs --state state",
)
"""Programs that the tests of this file start and stop."""
ELSEWHERE = {
    r"autopilot .*--autopilot-id": "tests/clients/test_other_tools.py",
    r"autopilot .*--sign": "tests/processes/test_links.py",
    r"autopilot .*--supervised": "tests/processes/test_supervisor.py",
    r"(autopilot .*--system-id|sitl .*--place)": "tests/clients/test_fleet.py",
    r"ground bench-test": "tests/ground/bench_tests/test_bench.py",
    r"ground inclining-test": "tests/ground/bench_tests/test_bench.py",
    r"ground campaign .*--resume": "tests/ground/campaign/test_resume.py",
    r"ground campaign": "tests/ground/campaign/test_run.py",
    r"ground fly .*--connect": "tests/processes/test_hardware.py",
    r"ground (hold|surface)": "tests/processes/test_stopping.py",
    r"ground (arm|mode|stop)": "tests/ground/client/test_stopping.py",
    r"ground live": "tests/ground/cli/test_live.py",
    r"ground paper .*--no-flights": "tests/ground/test_command_line.py",
    r"ground params load gians.param": "tests/ground/test_command_line.py",
    r"ground redesign .*--upload": "tests/ground/cli/test_redesign.py",
    r"ground refit .*--segment": "tests/ground/log_tools/test_foreign.py",
    r"ground simulate": "tests/ground/cli/test_simulate.py",
    r"ground sweep": "tests/ground/cli/test_sweep.py",
    r"ground watch": "tests/ground/live/test_watch.py",
    r"sitl --autopilot px4": "tests/peers/test_px4.py",
    r"sitl --autopilot ardupilot": "tests/peers/test_ardupilot.py",
    r"sitl .*--no-lockstep": "tests/processes/test_hardware.py",
}
"""File with the test that runs a command, by pattern; the first one that matches."""
FUNCTIONS = {
    r"autopilot .*--controller": "tests/autopilot/test_lqg_file.py",
    r"ground redesign .*--method lqg": "tests/sysid/design/test_lqg.py",
    r"ground replay .*--new-controller": "tests/sysid/monte_carlo/test_replay.py",
    r"ground fly .*--sign": "tests/processes/test_links.py",
    r"(autopilot|ground surface) .*--modem": "tests/autopilot/comms/test_high_latency.py",
    r"ground design-test": "tests/processes/test_design_test.py",
    r"ground paper": "tests/ground/paper/test_reproduction.py",
}
"""File with a test that calls the function of a command with its options as arguments."""


class Signature(NamedTuple):
    """Name of a command and its options."""

    name: str
    options: frozenset[str]


def signature(words: tuple[str, ...]) -> Signature:
    command, names, rest = PROGRAMS[words[0]], [words[0]], list(words[1:])
    while rest and (inner := getattr(command, "commands", {}).get(rest[0])):
        names.append(rest.pop(0))
        command = inner
    return Signature(" ".join(names), frozenset(w for w in rest if w.startswith("--")))


def first_match(table: dict[str, str], command: str) -> str | None:
    return next((file for pattern, file in table.items() if re.match(pattern, command)), None)


def run(words: tuple[str, ...], folder: Path) -> None:
    """Run a command in a folder."""
    run_python("-m", *words, folder=folder)


def commands_of_tutorial(name: str) -> list[tuple[str, ...]]:
    page = DOCS / "tutorials" / f"{name}.md"
    return [tuple(words) for words in commands_of(page) if not " ".join(words).startswith(NOT_HERE)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder in which a reader works: the vehicle file of the documentation and a mission."""
    folder = tmp_path_factory.mktemp("reader")
    (folder / "docs").mkdir()
    shutil.copy(DOCS / "my_vehicle.toml", folder / "docs")
    page = (DOCS / "tutorials" / "first_flight.md").read_text("utf-8")
    (mission,) = re.findall(r"^```toml\n(.*?)^```", page, re.M | re.S)
    (folder / "first.toml").write_text(mission, encoding="utf-8")
    return folder


@cache
def run_tutorial(name: str, folder: Path) -> None:
    """Run the commands of a tutorial, once."""
    for words in commands_of_tutorial(name):
        run(words, folder)


@cache
def run_commands_that_use_files(folder: Path) -> None:
    """Run FILES, once, after the tutorials."""
    for name in TUTORIALS:
        run_tutorial(name, folder)
    # Files of a campaign for the sweep; the last command here writes the model of another vehicle.
    (folder / "campaign").mkdir()
    for name in ("model.json", "gains.param"):
        shutil.copy(folder / name, folder / "campaign")
    for copy, original in (
        ("before.mcap", "run.mcap"),
        ("dive1.mcap", "steps_r.mcap"),
        ("dive2.mcap", "steps_e.mcap"),
    ):
        shutil.copy(folder / original, folder / copy)
    # the prior has to be a file of the vehicle that flew
    shutil.copy(ROOT / "sitl" / "vehicle" / "caribou_nominal.toml", folder / "my_vehicle.toml")
    for command in FILES:
        run(tuple(command.split()), folder)


@cache
def run_sweep(folder: Path) -> str:
    """Fly the plan as documented with fewer samples, once; return the report."""
    run_commands_that_use_files(folder)
    plan, *_ = (b.text for b in blocks_of(DOCS / "sweep.md") if b.first_line == "# class.toml")
    fewer, count = re.subn(r"^samples = \d+", "samples = 2", plan, flags=re.M)
    assert count == 1
    (folder / "class.toml").write_text(fewer, encoding="utf-8")
    run(("ground", "sweep", "class.toml"), folder)
    return run_python("-m", "ground", "sweep", "report", "class", folder=folder)


@pytest.mark.parametrize("name", TUTORIALS)
def test_tutorial_runs_as_written(name: str, folder: Path) -> None:
    run_tutorial(name, folder)


def test_commands_that_use_files_run(folder: Path) -> None:
    run_commands_that_use_files(folder)


def test_sweep_of_the_docs_is_flown_and_reported(folder: Path) -> None:
    """The report has the documented headings."""
    blocks = blocks_of(DOCS / "sweep.md")
    shown, *_ = (b.text for b in blocks if b.first_line.startswith("$ ground sweep class.toml"))
    report = run_sweep(folder)
    headings = [line.split() for line in shown.splitlines() if line.startswith(" vehicle")]
    assert headings
    assert all(words in [line.split() for line in report.splitlines()] for words in headings)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("page", "make_files"),
    [
        ("gains.md", run_commands_that_use_files),
        ("logs.md", partial(run_tutorial, TUTORIALS[0])),
        ("sweep.md", run_sweep),
    ],
    ids=["gains", "logs", "sweep"],
)
def test_python_of_page_runs(page: str, make_files: Callable[[Path], object], folder: Path) -> None:
    """The programs use files that commands of the documentation make."""
    make_files(folder)
    shutil.copy(folder / "run.mcap", folder / "dive.mcap")
    (folder / "page.py").write_text(python_of(page), encoding="utf-8")
    assert run_python("page.py", folder=folder)


def test_campaign_with_a_live_page_is_interrupted(folder: Path) -> None:
    words = ("campaign", "--live", "--out", str(folder / "live"))
    with process("-m", "ground", *words) as child:
        while not (address := re.search(r"http://127.0.0.1:\d+/", child.wait_for_line())):
            pass
        with urllib.request.urlopen(address[0], timeout=60) as page:
            assert b"<html" in page.read()
        while "prototype flight" not in child.wait_for_line():
            pass
        child.signal(signal.SIGINT)
        assert child.finish(timeout_s=300.0).status == 130


def test_commands_that_use_a_vehicle_run(folder: Path) -> None:
    port = free_port()
    options = ("--logs", str(folder / "logs"), "--state", str(folder / "state"))
    with vehicle(f"tcpin:127.0.0.1:{port}", speed="20", options=options):
        for command in VEHICLE:
            run(tuple(command.replace("ADDRESS", f"tcp:127.0.0.1:{port}").split()), folder)
    assert (folder / "second.mcap").exists()


def test_simulator_of_the_users_vehicle_starts() -> None:
    words = ("-m", "sitl", "--vehicle", str(DOCS / "my_vehicle.toml"), "--scenario", "swell")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(300.0)
        address = f"udpout:127.0.0.1:{peer.getsockname()[1]}"
        with process(*words, "--seed", "7", "--hil", address) as simulator:
            assert peer.recv(1024)
            simulator.signal(signal.SIGINT)
            assert simulator.finish().status == 0


def test_autopilot_of_the_tutorial_holds_depth_and_heading(tmp_path: Path) -> None:
    port, truth = free_port(), tmp_path / "truth.mcap"
    sea = ("-m", "sitl", "--scenario", "disturbed", "--hil", f"udpout:127.0.0.1:{port}")
    example = (str(ROOT / "examples" / "autopilot.py"), "--port", str(port), "--seconds", "120")
    with process(*sea, "--speed", "max", "--truth", str(truth)) as simulator:
        with process(*example, "--depth", "3", "--heading", "90") as program:
            finished = program.finish()
        assert finished.status == 0, finished.stderr
        simulator.signal(signal.SIGINT)
        assert simulator.finish().status in (0, 130)
    (tmp_path / "page.py").write_text(
        python_of("tutorials/own_autopilot.md") + "\nprint(json.dumps(states))", encoding="utf-8"
    )
    states = json.loads(run_python("page.py", folder=tmp_path))
    # means over the last 20 s of vehicle time: the sea moves the vehicle about them
    depth_m = mean(state["position_ned_m"][2] for state in states[-1000:])
    w, _, _, z = (mean(state["attitude_q"][k] for state in states[-1000:]) for k in range(4))
    assert depth_m == pytest.approx(3.0, abs=0.2)
    assert math.degrees(2.0 * math.atan2(z, w)) == pytest.approx(90.0, abs=3.0)


def test_every_command_is_run() -> None:
    run_here = [signature(words) for name in TUTORIALS for words in commands_of_tutorial(name)] + [
        signature(tuple(command.split())) for command in (*FILES, *VEHICLE, *PROGRAMS_OF_TESTS)
    ]
    missing = []
    for words in COMMANDS:
        name, options = signature(words)
        if any(name == other and options <= more for other, more in run_here):
            continue
        command = " ".join(words)
        if file := first_match(FUNCTIONS, command):
            assert (ROOT / file).exists()
            continue
        file = first_match(ELSEWHERE, command)
        text = HELPERS.read_text("utf-8") + (ROOT / file).read_text("utf-8") if file else ""
        if any(word.strip("-") not in text for word in (name.split()[-1], *options)):
            missing.append(command)
    assert not missing, "\n".join(missing)
