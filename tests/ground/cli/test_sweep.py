"""`ground sweep`: same rows for any number of processes and after kills; one dive; the report."""

import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.main import app
from mavlink_io.errors import InputError
from tests.browser import check_layout, needs_chromium, opened
from tests.ground.sweep.conftest import folder as folder
from tests.helpers.subprocesses import wait_for

ROOT = Path(__file__).parents[3]


def sweep(*words: str | Path) -> tuple[str, BaseException | None]:
    ended = CliRunner().invoke(app, ["sweep", *map(str, words)])
    return ended.stdout, ended.exception


def flown(plan: Path, out: str, jobs: int = 1) -> str:
    """Fly a sweep and return its digest."""
    output, failure = sweep(plan, "--out", plan.parent / out, "--jobs", str(jobs), "--json")
    assert failure is None, failure
    return str(json.loads(output)["digest"])


def start(plan: Path, out: str) -> "subprocess.Popen[bytes]":
    """Start a sweep on two processes."""
    words = ["sweep", str(plan), "--out", str(plan.parent / out), "--jobs", "2"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", "ground", *words], env=environment, stdout=subprocess.DEVNULL
    )


def children(process: int) -> list[int]:
    """Return the processes that a process has started."""
    listed = subprocess.run(
        ["pgrep", "-P", str(process)], capture_output=True, text=True, check=False
    )
    return [int(word) for word in listed.stdout.split()]


def workers(process: int) -> list[int]:
    """Return the workers of a sweep: the children of its fork server."""
    return [worker for child in children(process) for worker in children(child)]


@pytest.mark.process
def test_sweep_killed_twice_has_digest_of_undisturbed_one(folder: Path) -> None:
    plan = folder / "plan.toml"
    plan.write_text(plan.read_text().replace("samples = 6", "samples = 80"))  # 160 dives
    undisturbed = flown(plan, "undisturbed")

    def count() -> int:
        return len(list((folder / "killed" / "parts").glob("*.csv")))

    study = start(plan, "killed")
    wait_for(lambda: count() > 20)
    os.kill(workers(study.pid)[0], signal.SIGKILL)
    before = count()
    wait_for(lambda: count() > before + 20)  # goes on with another worker
    study.kill()
    study.wait()
    assert count() < 160, "the sweep was to be killed before its end"
    kept = {path.name: path.stat().st_mtime_ns for path in (folder / "killed/parts").glob("*.csv")}
    assert flown(plan, "killed", jobs=2) == undisturbed
    after = {path.name: path.stat().st_mtime_ns for path in (folder / "killed/parts").iterdir()}
    assert len(after) == 160
    assert kept.items() <= after.items(), "kept dives are not flown again"


@pytest.mark.process
def test_sweep_same_digest_for_one_and_two_processes(folder: Path) -> None:
    plan = folder / "plan.toml"
    assert flown(plan, "one", jobs=1) == flown(plan, "two", jobs=2)


@pytest.mark.slow
def test_command_of_row_flies_same_dive(folder: Path) -> None:
    flown(folder / "plan.toml", "out")
    (path,) = (folder / "out" / "parts").glob("part-000000007-*.csv")
    with path.open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    words = row["command"].split()
    assert words[:3] == ["ground", "sweep", "plan.toml"]
    output, failure = sweep(folder / words[2], *words[3:])
    assert failure is None
    assert output == path.read_text()
    as_json, _ = sweep(folder / words[2], *words[3:], "--json")
    assert json.loads(as_json) == row


@pytest.mark.slow
def test_command_of_row_after_a_change_says_so(folder: Path) -> None:
    plan = folder / "plan.toml"
    flown(plan, "plan")
    ended = CliRunner().invoke(app, ["sweep", str(plan), "--dive", "7"])
    assert ended.stderr == ""
    (folder / "soft.param").write_text("HDG_P,0.4\nHDG_D,1.5\n")
    ended = CliRunner().invoke(app, ["sweep", str(plan), "--dive", "7"])
    assert "has another row: the plan, its files or the source code changed" in ended.stderr


@pytest.mark.slow
def test_more_samples_keep_dives_other_gains_do_not(folder: Path) -> None:
    plan = folder / "plan.toml"
    flown(plan, "out")
    first = {path.name for path in (folder / "out" / "parts").iterdir()}
    plan.write_text(plan.read_text().replace("samples = 6", "samples = 7"))
    flown(plan, "out")
    assert first < {path.name for path in (folder / "out" / "parts").iterdir()}
    (folder / "soft.param").write_text("HDG_P,0.4\nHDG_D,1.5\n")
    flown(plan, "out")
    names = {path.name for path in (folder / "out" / "parts").iterdir()}
    assert len(names) == 14
    assert len(list((folder / "out" / "superseded").iterdir())) == 7
    assert len(names & first) == 6


@pytest.mark.slow
def test_report_writes_page_and_csv(folder: Path) -> None:
    flown(folder / "plan.toml", "out")
    output, failure = sweep("report", folder / "out")
    assert failure is None
    assert "plan.toml: 12 dives" in output
    assert "held" in output
    assert "soft" in output
    with (folder / "out" / "cells.csv").open(newline="", encoding="utf-8") as file:
        held, soft = csv.DictReader(file)
    assert (held["gains"], held["dives"], held["passed"]) == ("held", "6", "6")
    assert soft["gains"] == "soft"
    assert 0.5 < float(held["low"]) < 1.0 == float(held["high"])
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    for expected in ("Pass probability", "Worst dives", "--dive 7", 'id="sweep-heading_deg"'):
        assert expected in page
    assert '<p class="lead">12 dives</p>' in page, "the heading above it has the name of the plan"
    assert "$" not in page.split("<script", maxsplit=1)[0], "every place is filled"
    as_json, _ = sweep("report", folder / "out", "--json")
    assert json.loads(as_json)["cells"][0]["passed"] == 6


@needs_chromium
@pytest.mark.process
@pytest.mark.timeout(120)
def test_report_page_keeps_its_layout_in_a_browser(folder: Path) -> None:
    flown(folder / "plan.toml", "out")
    sweep("report", folder / "out")
    with opened(folder / "out" / "report.html", folder / "profile") as shown:
        assert len(shown.charts()) == 4
        check_layout(shown)


@pytest.mark.slow
def test_report_of_unfinished_sweep_says_so(folder: Path) -> None:
    flown(folder / "plan.toml", "out")
    next(iter((folder / "out" / "parts").iterdir())).unlink()
    output, _ = sweep("report", folder / "out")
    assert "11 dives of 12; the sweep is not finished" in output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nowhere.toml",), "nowhere.toml: No such file"),
        (("plan.toml", "--dive", "12"), "--dive 12: must be 0 to 11"),
        (("plan.toml", "--engine", "ray"), "--engine ray: must be local"),
        (("plan.toml", "--out", "."), "is not the folder of a sweep; give a new one"),
        (("report", "."), "is not the folder of a sweep"),
    ],
)
def test_sweep_mistake_is_one_line(folder: Path, words: tuple[str, ...], said: str) -> None:
    paths = [
        str(folder / word) if word.endswith((".toml", ".")) and word != "report" else word
        for word in words
    ]
    output, failure = sweep(*paths)
    assert output == ""
    assert isinstance(failure, InputError)
    assert said in str(failure)
    assert "\n" not in str(failure)
