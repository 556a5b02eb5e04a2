"""The state of the vehicle on one time base."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sysid.data import readers, state_table
from sysid.data.dataset import Log, Position, Setpoints, Velocity
from sysid.data.state_table import COLUMNS
from tests.sysid.data.readers import test_damage as damaged


@pytest.fixture
def log(tmp_path: Path) -> Log:
    return readers.read(damaged.write_own(tmp_path / "dive.mcap"))


def test_table_has_every_column_at_the_times_of_the_attitude(log: Log) -> None:
    table = state_table.state_table(log)
    assert tuple(table) == COLUMNS
    assert {values.size for values in table.values()} == {log.attitude.time_s.size}
    assert np.array_equal(table["pitch_rad"], log.attitude.pitch_rad)
    assert np.all((table["heading_rad"] >= 0) & (table["heading_rad"] < 2 * np.pi))
    depth = np.interp(log.depth.time_s, table["time_s"], table["depth_m"])
    inside = (log.depth.time_s > table["time_s"][1]) & (log.depth.time_s < table["time_s"][-2])
    assert depth[inside] == pytest.approx(log.depth.depth_m[inside], abs=0.02)


def test_commands_hold_their_value_until_the_next(log: Log) -> None:
    time_s = log.attitude.time_s
    held = replace(
        log,
        setpoints=Setpoints(
            attitude_time_s=np.empty(0),
            heading_rad=np.empty(0),
            pitch_rad=np.empty(0),
            depth_time_s=time_s[[10, 30]],
            depth_m=np.array([2.0, 5.0]),
        ),
    )
    depth_m = state_table.state_table(held)["depth_setpoint_m"]
    assert np.isnan(depth_m[:10]).all()
    assert set(depth_m[10:30]) == {2.0}
    assert set(depth_m[30:]) == {5.0}
    assert np.isnan(state_table.state_table(held)["heading_setpoint_rad"]).all()


def test_position_without_record_is_dead_reckoned(log: Log) -> None:
    time_s = np.arange(0.0, 20.01, 0.1)
    level = np.zeros_like(time_s)
    attitude = replace(
        log.attitude,
        time_s=time_s,
        roll_rad=level,
        pitch_rad=level,
        yaw_rad=level + np.radians(30.0),
        **dict.fromkeys(("p_radps", "q_radps", "r_radps"), level),
    )
    straight = replace(
        log,
        attitude=attitude,
        position=Position(),
        velocity=Velocity(time_s, level + 1.5, level + 0.2, level),
    )
    table = state_table.state_table(straight)
    # 20 s at 1.5 m/s forward and 0.2 m/s to starboard on a heading of 30 deg
    assert table["north_m"][-1] == pytest.approx(30 * np.cos(np.pi / 6) - 4 * np.sin(np.pi / 6))
    assert table["east_m"][-1] == pytest.approx(30 * np.sin(np.pi / 6) + 4 * np.cos(np.pi / 6))


def test_surface_under_test_is_named_during_the_test(log: Log) -> None:
    surfaces = state_table.tested_surfaces(log)
    assert set(surfaces) == {"", "rudder"}
    assert surfaces[0] == surfaces[-1] == ""
