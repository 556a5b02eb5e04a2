"""Moments of a shipped scenario scaled with the inertia; a file of the user stays as it is."""

import tomllib
from pathlib import Path

import pytest

from ground.campaign import readiness, scaled_scenario
from sitl import scenario

RATIOS = {"yaw": 0.01, "pitch": 0.02}


def test_scale_shipped_scenario_changes_moments_alone(tmp_path: Path) -> None:
    content = readiness.scenario_content("disturbed")
    scaled = scaled_scenario.scale("disturbed", content, RATIOS)
    expected = {
        "slow": {"time_constant_s": 3.0, "yaw_rms_nm": 0.0281, "pitch_rms_nm": 0.0448},
        "waves": {
            "frequency_hz": 0.15,
            "damping": 0.1,
            "yaw_rms_nm": 0.0496,
            "pitch_rms_nm": 0.0914,
        },
    }  # sitl/scenarios/disturbed.toml times the ratios
    assert tomllib.loads(scaled.text)["disturbance"] == expected
    path = tmp_path / "scenario.toml"
    path.write_text(scaled.text, encoding="utf-8")
    read = scenario.load(str(path))
    original = scenario.load("disturbed")
    assert read.site == original.site
    assert read.floor == original.floor


@pytest.mark.parametrize("name", scenario.names())
def test_encode_shipped_scenario_is_read_back(name: str, tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(scaled_scenario.encode(readiness.scenario_content(name)), encoding="utf-8")
    assert scenario.load(str(path)) == scenario.load(name)


def test_scale_users_file_is_used_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[disturbance.slow]\nyaw_rms_nm = 2.0\n", encoding="utf-8")
    content = readiness.scenario_content(str(path))
    scaled = scaled_scenario.scale(str(path), content, RATIOS)
    assert (scaled.content, scaled.text) == (content, "")


def test_scale_scenario_without_moments_is_used_as_it_is() -> None:
    content = readiness.scenario_content("calm")
    assert scaled_scenario.scale("calm", content, RATIOS).text == ""
