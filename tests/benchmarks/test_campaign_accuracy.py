"""Accuracy of campaigns: the vehicle in the scenario's water, and shares of numbers inside."""

from pathlib import Path

import pytest

from benchmarks.campaigns import accuracy
from benchmarks.campaigns.accuracy import PlaneErrors
from sitl.vehicle import config
from sysid.planes import Plane


def test_vehicle_in_lighter_water_has_less_buoyancy(tmp_path: Path) -> None:
    """REMUS displaces 30 l: in water that is 5 kg/m3 lighter it loses 1.5 N."""
    (tmp_path / "scenario.toml").write_text("[water]\ndensity_kgpm3 = 1025.0\n")
    file = config.load("remus100")
    flown = accuracy.flown_vehicle(tmp_path, "remus100")
    assert flown.water.density_kgpm3 == 1025.0
    lost_n = file.ballast.net_buoyancy_n - flown.ballast.net_buoyancy_n
    assert lost_n == pytest.approx(0.03 * 5.0 * 9.81, rel=0.05)
    assert flown.ballast.mass_kg == file.ballast.mass_kg


def test_campaign_without_scenario_is_in_the_water_of_its_file(tmp_path: Path) -> None:
    assert accuracy.flown_vehicle(tmp_path, "caribou") == config.load("caribou_truth")


def test_folder_without_model_has_no_errors(tmp_path: Path) -> None:
    assert accuracy.errors_of(tmp_path) == []


def test_table_counts_numbers_within_two_standard_deviations() -> None:
    errors = [
        PlaneErrors("heavy", Plane.YAW, (0.0, 1.9, -1.9, 2.0, 0.0, -3.0), 0.1, -1.0),
        PlaneErrors("heavy", Plane.PITCH, (0.0, 2.1, -1.9, 2.0, 0.0, 0.0), -0.3, 2.0),
    ]
    rows = accuracy.table(errors)
    cells = [[*column.cells] for column in rows.columns]
    shares = ["100", "50", "100", "0", "100", "50", "67"]
    rms = ["0.10, 0.30", "1.00, 2.00"]
    assert [column[0] for column in cells] == ["heavy", "1", *shares, *rms]
    assert [column[1] for column in cells][1:] == [column[0] for column in cells][1:]
