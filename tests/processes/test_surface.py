"""``ground fly`` ends with a reason if the vehicle cannot surface."""

from pathlib import Path

import pytest

from tests.helpers.subprocesses import Finished, process

pytestmark = pytest.mark.process

MISSION = """
name = "down"

[[step]]
depth_m = 3.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 20.0

[[step]]
surface = true
"""
SEA = """
title = "fault"
[start]
depth_m = 3.0
speed_mps = 1.2
[floor]
depth_m = 7.0
"""
STUCK = '[[fault]]\nunit = "elevator"\nkind = "stuck"\nangle_deg = -8.0\nat_s = 10.0\n'
HEAVY = """
[[fault]]
unit = "ballast"
kind = "added"
mass_kg = 10.0
at_s = 10.0
[[fault]]
unit = "propeller"
kind = "off"
at_s = 10.0
"""


def fly(folder: Path, faults: str) -> Finished:
    (folder / "down.toml").write_text(MISSION, encoding="utf-8")
    (folder / "sea.toml").write_text(SEA + faults, encoding="utf-8")
    files = "--scenario", str(folder / "sea.toml"), "--log", str(folder / "dive.mcap")
    with process("-m", "ground", "fly", str(folder / "down.toml"), "--sitl", *files) as ground:
        return ground.finish(timeout_s=240.0)


def test_fly_elevator_stuck_down_ends_with_reason(tmp_path: Path) -> None:
    finished = fly(tmp_path, STUCK)
    assert finished.status == 1, finished
    last_line = finished.stderr.splitlines()[-1]
    assert "Failsafe: Elevator has no effect -> SURFACE" in last_line
    assert last_line.endswith("-> propeller stopped")


def test_fly_vehicle_too_heavy_to_surface_ends_with_reason(tmp_path: Path) -> None:
    finished = fly(tmp_path, HEAVY)
    assert finished.status == 1, finished
    reason = "Failsafe: surface not reached, no rise for 300 s -> disarmed"
    assert finished.stderr.splitlines()[-1].endswith(reason)


def test_fly_vehicle_held_below_the_surface_by_power_ends_with_reason(tmp_path: Path) -> None:
    """Brackish water above: the vehicle is 82 N too heavy there, and sinks without power."""
    (tmp_path / "down.toml").write_text(MISSION, encoding="utf-8")
    log = tmp_path / "dive.mcap"
    words = "fly", str(tmp_path / "down.toml"), "--sitl", "--scenario", "estuary", "--log", str(log)
    with process("-m", "ground", *words) as ground:
        finished = ground.finish(timeout_s=240.0)
    assert finished.status == 1, finished
    reason = "m deep in mode SURFACE, without a change of depth for 1800 s: is the vehicle heavier"
    assert reason in finished.stderr.splitlines()[-1]
    assert log.stat().st_size > 0
