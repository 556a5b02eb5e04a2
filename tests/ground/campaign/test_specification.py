"""Specification from defaults, file and options; invalid limits are named."""

from pathlib import Path
from typing import Any, NamedTuple

import pytest

from ground.campaign import refit, specification
from mavlink_io.errors import InputError
from sitl.vehicle import config
from sitl.vehicle.config import VehicleConfig
from sysid.design.pid import Spec


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "spec.toml"
    path.write_text("damping = 0.7\nmax_sensitivity = 2\n")
    return path


def test_read_without_input_is_default() -> None:
    assert specification.read(None, {"max_sensitivity": None}) == Spec()


def test_read_option_overrides_file_overrides_vehicle(file: Path) -> None:
    found = specification.read(
        file, {"damping": 0.65, "gm_db": None}, Spec(travel_deg=20.0, max_sensitivity=1.5)
    )
    assert found == Spec(damping=0.65, max_sensitivity=2.0, travel_deg=20.0)


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("dampng = 0.6", r"spec\.toml: dampng: there is no such limit; expected one of damping, "),
        (
            "max_sensitivity = 0.5",
            r"spec\.toml: max_sensitivity = 0\.5: must be a number from 1\.05 to 10",
        ),
        ("max_sensitivity = 'low'", r"spec\.toml: max_sensitivity = 'low': must be a number"),
        ("max_sensitivity = true", r"spec\.toml: max_sensitivity = True: must be a number"),
        ("max_sensitivity = nan", r"spec\.toml: max_sensitivity = nan: must be a number"),
        ("max_sensitivity 2", r"spec\.toml: not TOML"),
    ],
)
def test_read_implausible_limit_is_named(text: str, wrong: str, tmp_path: Path) -> None:
    path = tmp_path / "spec.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=wrong):
        specification.read(path, {})


def test_bounds_cover_every_limit() -> None:
    assert set(specification.BOUNDS) == set(Spec.__struct_fields__)
    for name, (low, high) in specification.BOUNDS.items():
        assert low <= getattr(Spec(), name) <= high


def test_read_error_names_the_option() -> None:
    with pytest.raises(InputError, match=r"--gm-db 99\.0: must be a number from 1 to 40"):
        specification.read(None, {"gm_db": 99.0})


def test_read_error_names_an_option_of_two_words() -> None:
    with pytest.raises(InputError, match=r"--max-sensitivity 0\.5: must be a number from 1\.05"):
        specification.read(None, {"max_sensitivity": 0.5})


class RefittedVehicle(NamedTuple):
    file: VehicleConfig


class Refitted(NamedTuple):
    """Stand-in for a model; it holds its vehicle file."""

    vehicle: RefittedVehicle


def test_specification_takes_limits_of_tailcone() -> None:
    remus, mine = config.load("remus100"), config.load("docs/my_vehicle.toml")
    model: Any = Refitted(RefittedVehicle(remus))
    for prior, tail in ((None, remus.tailcone), ("docs/my_vehicle.toml", mine.tailcone)):
        found = refit.specification(model, prior)
        assert found == Spec(travel_deg=tail.travel_deg, rate_degps=tail.rate_degps)
        assert found != Spec()
