"""Check of a vehicle file with its instruments."""

from pathlib import Path

import pytest

from sitl import vehicle_check
from sitl.vehicle.config import SHIPPED, Instruments, VehicleFileError
from tests.sitl.vehicle.test_fill_missing import FINNED


def written(tmp_path: Path, part: str) -> Path:
    """Write a vehicle file with an additional table."""
    file = tmp_path / "mine.toml"
    file.write_text(f"{FINNED}\n{part}")
    return file


@pytest.mark.parametrize("name", [*SHIPPED, "docs/my_vehicle.toml"])
def test_shipped_vehicle_can_be_flown(name: str) -> None:
    assert vehicle_check.check_flight(name).warnings == vehicle_check.check(name).warnings


@pytest.mark.parametrize("kind", Instruments.__struct_fields__)
def test_unknown_instrument_refused_with_file_and_choices(kind: str, tmp_path: Path) -> None:
    file = written(tmp_path, f'[instruments]\n{kind} = "nortek"\n')
    with pytest.raises(
        VehicleFileError, match=rf"mine\.toml: instruments\.{kind} = 'nortek': unknown; known here"
    ):
        vehicle_check.check(file)


@pytest.mark.parametrize("kind", vehicle_check.NEEDED_TO_ARM)
def test_vehicle_that_cannot_arm_refused_before_flight(kind: str, tmp_path: Path) -> None:
    file = written(tmp_path, f'[instruments]\n{kind} = "none"\n')
    assert f'instruments.{kind} = "none"' in vehicle_check.check(file).warnings[-1]
    with pytest.raises(
        VehicleFileError, match=rf'mine\.toml: instruments\.{kind} = "none": .*; expected \w+'
    ):
        vehicle_check.check_flight(file)


def test_drop_weight_too_heavy_refused_with_file(tmp_path: Path) -> None:
    file = written(tmp_path, "[drop_weight]\nmass_kg = 500.0\n")
    with pytest.raises(VehicleFileError, match=r"mine\.toml: drop_weight\.mass_kg = 500: expected"):
        vehicle_check.check(file)
