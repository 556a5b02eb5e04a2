"""The first flight of the README holds its heading and reports the error after the flight."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

pytestmark = pytest.mark.process

ROOT = Path(__file__).parents[2]
HEADING_DEG = 20.0
"""Wall time for `straight_run`, which lasts 300 s of vehicle time."""
TEST_DIVE = """
name = "one test"

[[step]]
depth_m = 3.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 40.0

[[step]]
test = { signal = "doublet", axis = "rudder", magnitude_deg = 5.0, duration_s = 12 }

[[step]]
surface = true
"""


def ground(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ground", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True)


def first_flight() -> list[str]:
    """Return the arguments of the README's first `ground fly`, with the mission's full path."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    line, *_ = re.findall(r"^ground (fly \S+ --sitl .*?) +#", readme, re.M)
    return [str(ROOT / word) if word.startswith("ground/") else word for word in shlex.split(line)]


def test_first_flight_of_the_readme_holds_its_heading(tmp_path: Path) -> None:
    """Check the heading with the truth log.

    Without a trim the error was 8.4 deg.
    """
    done = ground(*first_flight(), "--truth", "truth.mcap", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    with (tmp_path / "truth.mcap").open("rb") as file:
        states = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages()]
    time_s = np.array([state["time_us"] for state in states]) / 1e6
    w, x, y, z = np.array([state["attitude_q"] for state in states]).T
    heading_deg = np.degrees(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    second_half = (time_s > 150.0) & (time_s < 300.0)
    assert np.mean(heading_deg[second_half]) == pytest.approx(HEADING_DEG, abs=1.0)
    found = result["assessment"]
    assert (found["reason"], found["findings"]) == ("", [])
    assert found["legs"][0]["heading_deg"]["p95"] < 2.5
    assert found["trims_learned"].startswith("TRIM_RUD_DEG 6")


def test_dive_with_tests_and_no_trims_names_the_remedy(tmp_path: Path) -> None:
    """Tests start from the trims, so that a dive with tests learns none."""
    (tmp_path / "one.toml").write_text(TEST_DIVE, encoding="utf-8")
    done = ground("fly", "one.toml", "--sitl", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    (verdict,) = [line for line in lines if line.startswith("needs attention: ")]
    assert re.search(r"heading 8\.\d deg off in the mean: the rudder trim is not set", verdict)
    (step,) = [line for line in lines if line.startswith("next: ")]
    assert re.search(r"set TRIM_RUD_DEG to (5\.9|6\.\d)", step)
