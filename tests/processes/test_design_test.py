"""From a vehicle file to a model: tests are designed, flown and fitted by the command line."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.process

FLIGHT = ["--sitl", "--scenario", "disturbed"]


def ground(folder: Path, *asked: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", "ground", *asked, "--json"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (0, 1), done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


@pytest.mark.timeout(900)
def test_designed_tests_are_flown_and_fitted(tmp_path: Path) -> None:
    ground(tmp_path, "fly", "trim", *FLIGHT, "--log", "trim.mcap")
    plan = ground(
        tmp_path, "design-test", "--trim", "trim.mcap", "--duration", "10", "--samples", "60"
    )
    flown = ("--params", "tests.param", *FLIGHT)
    ground(tmp_path, "fly", "tests.toml", *flown, "--log", "tests.mcap")
    ground(tmp_path, "refit", "tests.mcap", "--out", "model.json")
    model = json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))
    runs_of = [one for one in plan["tests"] for _ in range(2 if one["surface"] == "both" else 1)]
    for run, planned in zip(model["screening"], runs_of, strict=True):
        assert run["accepted"], (run["run"], run["reasons"])
        assert run["duration_s"] == pytest.approx(planned["duration_s"], abs=0.1)
