"""Replays of flown dives reproduce them: a mission with waypoints, and a dive with LQG."""

import shutil
import sys
from pathlib import Path

import pytest

import caribou_auv as auv
from autopilot.control import lqg_file
from tests.helpers.lqg import lqg_controllers

pytestmark = [pytest.mark.process, pytest.mark.slow]


def test_dive_with_waypoints_is_reproduced(tmp_path: Path) -> None:
    """The recorded navigation has fixes, a Doppler log and a current; the replay has neither."""
    flown = auv.fly("square", tmp_path / "square.mcap", scenario="disturbed", seed=1)
    again = auv.replay(flown.log_file, {})
    # 0.43 deg, 0.9 cm and 0.26 deg measured; by dead reckoning 11 deg, 2.1 cm and 2.5 deg
    assert again.unchanged.finished
    assert again.fidelity.heading_deg < 1.0
    assert again.fidelity.depth_m < 0.03
    assert again.fidelity.rudder_deg < 0.6


def test_dive_with_lqg_is_reproduced(tmp_path: Path) -> None:
    controller = tmp_path / "controller.json"
    controller.write_text(lqg_file.to_json(lqg_controllers(), "0" * 64), encoding="utf-8")
    program = shutil.which("autopilot", path=str(Path(sys.executable).parent))
    assert program
    flown = auv.fly(
        "combined",
        tmp_path / "lqg.mcap",
        scenario="disturbed",
        seed=1,
        autopilot=(program, "--controller", str(controller)),
    )
    again = auv.replay(flown.log_file, {}, controller=controller)
    # 0.07 deg, 1.2 cm, 0.32 deg and 0.44 deg measured
    assert again.unchanged.finished
    assert again.fidelity.heading_deg < 0.3
    assert again.fidelity.depth_m < 0.03
    assert again.fidelity.rudder_deg < 0.8
    assert again.fidelity.elevator_deg < 1.0
