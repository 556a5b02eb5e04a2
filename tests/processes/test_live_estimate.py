"""The estimate of a test is shown during the flight and is part of the result."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

MISSION = """
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


@pytest.mark.parametrize("as_json", [False, True])
def test_live_estimate_during_a_test(tmp_path: Path, as_json: bool) -> None:
    (tmp_path / "one.toml").write_text(MISSION, encoding="utf-8")
    asked = ["fly", "one.toml", "--sitl", "--scenario", "calm", *(["--json"] if as_json else [])]
    done = subprocess.run(
        [sys.executable, "-m", "ground", *asked], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "yaw: b1 " in done.stderr
    assert "prior +-" in done.stderr
    if not as_json:
        return
    b1 = json.loads(done.stdout)["estimates"]["yaw"]["b1_per_s2"]
    assert b1["sd"] < 0.5 * b1["prior_sd"]
    assert abs(b1["value"] - 0.51) < 4.0 * b1["sd"]
