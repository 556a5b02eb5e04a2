"""A vehicle described in a few lines is flown by the command line and follows its mission."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

pytestmark = pytest.mark.process

VEHICLE = """
name = "mine"

[hull]
shape = "cylinder"
length_m = 1.8
diameter_m = 0.18
tail_cap_m = 0.30

[ballast]
net_buoyancy_n = 2.0

[fins]
layout = "cruciform"
span_m = 0.10
root_chord_m = 0.09
"""
MISSION = """
name = "two legs"

[[step]]
depth_m = 3.0
heading_deg = 20.0
speed_mps = 1.5
duration_s = 45.0

[[step]]
depth_m = 5.0
heading_deg = -40.0
duration_s = 45.0

[[step]]
surface = true
"""
LEGS = ((45.0, 3.0, 20.0), (90.0, 5.0, -40.0))
"""End time, depth and heading of each leg."""
HELD_S = 10.0
DEPTH_M, HEADING_DEG = 0.15, 1.0


def test_vehicle_of_thirty_lines_holds_depth_and_heading(tmp_path: Path) -> None:
    """The check uses the true state, not the estimate; all gains come from the vehicle's file."""
    assert len(VEHICLE.splitlines()) < 30
    (tmp_path / "mine.toml").write_text(VEHICLE, encoding="utf-8")
    (tmp_path / "legs.toml").write_text(MISSION, encoding="utf-8")
    asked = ["fly", "legs.toml", "--sitl", "--vehicle", "mine.toml", "--truth", "truth.mcap"]
    done = subprocess.run(
        [sys.executable, "-m", "ground", *asked], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    with (tmp_path / "truth.mcap").open("rb") as file:
        states = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages()]
    time_s = np.array([state["time_us"] for state in states]) / 1e6
    depth_m = np.array([state["position_ned_m"][2] for state in states])
    w, x, y, z = np.array([state["attitude_q"] for state in states]).T
    heading_deg = np.degrees(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    for end_s, depth, heading in LEGS:
        held = (time_s > end_s - HELD_S) & (time_s < end_s)
        assert held.any()
        assert depth_m[held] == pytest.approx(depth, abs=DEPTH_M)
        assert heading_deg[held] == pytest.approx(heading, abs=HEADING_DEG)
