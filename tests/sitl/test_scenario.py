"""Scenario files: valid content, and the error message of each mistake."""

import re
from pathlib import Path

import pytest
from msgspec.structs import replace

from sitl import scenario
from sitl.environment_schema import CurrentConfig
from sitl.scenario_types import ScenarioError


@pytest.mark.parametrize("name", scenario.names())
def test_supplied_scenario_title_equals_name(name: str) -> None:
    assert scenario.load(name).title == name


def test_calm_and_disturbed_differ_in_disturbance_only() -> None:
    calm, disturbed = scenario.load("calm"), scenario.load("disturbed")
    assert calm.disturbance != disturbed.disturbance
    assert replace(calm, title=disturbed.title, disturbance=disturbed.disturbance) == disturbed


def test_scenario_file_overrides_defaults(tmp_path: Path) -> None:
    file = tmp_path / "current.toml"
    file.write_text("[current]\nspeed_mps = 0.2\ntowards_deg = 30\n[start]\ndepth_m = 4.0\n")
    loaded = scenario.load(str(file))
    assert loaded.current == CurrentConfig(speed_mps=0.2, towards_deg=30.0)
    assert loaded.start.depth_m == 4.0
    assert loaded.site == scenario.Site()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[water]\ndensity_kgpm3 = -3.0",
            "water.density_kgpm3 = -3.0: expected float >= 900 and <= 1300",
        ),
        (
            "[water]\nsurface_pressure_hpa = 1.013",
            "water.surface_pressure_hpa = 1.013: expected float >= 400 and <= 1100",
        ),
        (
            "[current.variation]\ntime_constant_s = 1e-6",
            "current.variation.time_constant_s = 1e-06: expected float >= 0.05 and <= 1e+06",
        ),
        (
            "[disturbance.waves]\nfrequency_hz = 150.0",
            "disturbance.waves.frequency_hz = 150.0: expected float >= 0.001 and <= 10",
        ),
        ("[start]\nheading_deg = 'north'", "start.heading_deg = 'north': expected float, got str"),
        (
            "[disturbance.waves]\nheight_m = 2",
            "disturbance.waves.height_m = 2: unknown key; known here: frequency_hz, damping",
        ),
        ("swell = 3", "swell = 3: unknown key; known here: title, site"),
        (
            "[current]\nspeed_mps = [1.0, 2.0]",
            "current.speed_mps = [1.0, 2.0]: expected float, got array",
        ),
        ("[start]\nspeed_mps = 9.0", "start.speed_mps = 9.0: expected float >= -5 and <= 5"),
        ("[start]\nspeed_mps = inf", "start.speed_mps = inf: expected a finite number"),
        ("[start]\ndepth_m = nan", "start.depth_m = nan: expected a finite number"),
        ("water = 3", "water = 3: expected object, got int"),
        (
            "[[current.layer]]\ndepth_m = 1\nspeed_mps = 9\ntowards_deg = 0",
            "current.layer[0].speed_mps = 9: expected float >= -5 and <= 5",
        ),
        (
            "[[density.layer]]\ndepth_m = 1\ndensity = 1010",
            "density.layer[0].density = 1010: unknown key; known here: depth_m, density_kgpm3",
        ),
        (
            2 * "[[density.layer]]\ndepth_m = 2\ndensity_kgpm3 = 1010\n",
            "density.layer[1].depth_m = 2.0: expected more than 2.0, the depth of the layer before",
        ),
        (
            (
                "[current]\nspeed_mps = 0.1\n[[current.layer]]\ndepth_m = 1\nspeed_mps ="
                " 0.2\ntowards_deg = 0"
            ),
            "current.speed_mps = 0.1: expected either this key or current.layer",
        ),
        (
            "[waves]\nsignificant_height_m = 1",
            "waves.peak_period_s: missing key; a JONSWAP spectrum needs its peak period",
        ),
        (
            "[waves]\nspectrum = 'itu'",
            "waves.spectrum = 'itu': expected pierson-moskowitz or jonswap",
        ),
        (
            "[waves]\nsignificant_height_m = 1\npeak_period_s = 5\n[ice]\ndraft_m = 1",
            "ice.draft_m = 1.0: expected no [waves]",
        ),
        (
            "[waves]\nsignificant_height_m = 4.0\npeak_period_s = 4.0",
            (
                "waves.significant_height_m = 4.0: expected at most 3.6 with peak_period_s = 4.0:"
                " steeper waves break"
            ),
        ),
        (
            "[[fault]]\nunit = 'gyro'\nat_s = true",
            "fault[0] = {'unit': 'gyro', 'at_s': True}: expected float",
        ),
        ("[ice]\ndraft_m = 21", "ice.draft_m = 21.0: expected less than floor.depth_m = 20.0"),
        ("[start]\ndepth_m = 30", "start.depth_m = 30.0: expected less than floor.depth_m = 20.0"),
        (
            "[start]\ndepth_m = 0.5\n[ice]\ndraft_m = 1",
            "start.depth_m = 0.5: expected more than ice.draft_m = 1.0",
        ),
        ("=", "not valid TOML: "),
    ],
)
def test_error_names_file_key_and_value(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "mistake.toml"
    file.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        scenario.load(str(file))
    assert f"{file}: {message}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_name_error_lists_scenarios() -> None:
    with pytest.raises(
        ScenarioError, match=r"stormy: No such file.*calm, disturbed,.*or a TOML file"
    ):
        scenario.load("stormy")


def test_clamped_vehicle_with_start_speed_is_rejected(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text("[rig]\nclamped = true\n[start]\nspeed_mps = 1.0\n")
    with pytest.raises(ScenarioError, match=r"rig\.clamped = true: expected no start\.depth_m"):
        scenario.load(str(file))


def test_floor_file_is_relative_to_scenario(tmp_path: Path) -> None:
    (tmp_path / "bay.asc").write_text(
        "ncols 2\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 50\n-8 -9\n-7 -8\n"
    )
    (tmp_path / "bay.toml").write_text("[floor]\nfile = 'bay.asc'\n")
    assert scenario.load(str(tmp_path / "bay.toml")).floor.file == str(tmp_path / "bay.asc")
    (tmp_path / "ice.toml").write_text("[floor]\nfile = 'bay.asc'\n[ice]\ndraft_m = 9.0\n")
    with pytest.raises(
        ScenarioError, match=r"ice\.toml: ice\.draft_m = 9\.0: expected less than the floor's 9"
    ):
        scenario.load(str(tmp_path / "ice.toml"))
    (tmp_path / "bay.asc").write_text("ncols two\n")
    with pytest.raises(ScenarioError, match=r"bay\.asc: ncols = 'two': expected a number"):
        scenario.load(str(tmp_path / "bay.toml"))


def test_documented_scenarios_can_be_read(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    assert len(blocks) > 1
    for block in blocks:
        (tmp_path / "shown.toml").write_text(block)
        scenario.load(str(tmp_path / "shown.toml"))
    rows = re.findall(r"^\| (`.*?`) \|", page, re.MULTILINE)
    assert {name.strip("`") for row in rows for name in row.split(", ")} == set(scenario.names())
