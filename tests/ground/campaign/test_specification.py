"""A specification of one's own: what is given counts, the option before the file, and what cannot
be meant is named."""

from pathlib import Path
from typing import Any, NamedTuple

import pytest

from ground.campaign import refit, specification
from ground.errors import InputError
from sitl.vehicle import config
from sysid.design.pid import Spec


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "spec.toml"
    path.write_text("damping = 0.7\nms = 2\n")
    return path


def test_without_anything_it_is_the_tools_own() -> None:
    assert specification.read(None, {"ms": None}) == Spec()


def test_an_option_goes_before_the_file_and_the_file_before_the_vehicle(file: Path) -> None:
    found = specification.read(
        file, {"damping": 0.65, "gm_db": None}, Spec(travel_deg=20.0, ms=1.5)
    )
    assert found == Spec(damping=0.65, ms=2.0, travel_deg=20.0)


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("dampng = 0.6", r"spec\.toml: dampng: there is no such limit; expected one of damping, "),
        ("ms = 0.5", r"spec\.toml: ms = 0\.5: must be a number from 1\.05 to 10"),
        ("ms = 'low'", r"spec\.toml: ms = low: must be a number"),
        ("ms = true", r"spec\.toml: ms = True: must be a number"),
        ("ms = nan", r"spec\.toml: ms = nan: must be a number"),
        ("ms 2", r"spec\.toml: not TOML"),
    ],
)
def test_what_cannot_be_meant_is_named(text: str, wrong: str, tmp_path: Path) -> None:
    path = tmp_path / "spec.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=wrong):
        specification.read(path, {})


def test_every_limit_can_be_set() -> None:
    assert set(specification.BOUNDS) == set(Spec._fields)
    for name, (low, high) in specification.BOUNDS.items():
        assert low <= getattr(Spec(), name) <= high


def test_an_option_is_named_as_it_was_typed() -> None:
    with pytest.raises(InputError, match=r"--gm-db 99\.0: must be a number from 1 to 40"):
        specification.read(None, {"gm_db": 99.0})


def test_renamed_option_is_named_in_the_error() -> None:
    with pytest.raises(InputError, match=r"--max-sensitivity 0\.5: must be a number from 1\.05"):
        specification.read(None, {"ms": 0.5})


class Refitted(NamedTuple):
    """As much of a model as tells which vehicle it is of."""

    class Vehicle(NamedTuple):
        prior: str

    vehicle: Vehicle


def of(prior: str) -> Any:
    return Refitted(Refitted.Vehicle(prior))


def test_the_vehicles_own_tailcone_limits_her_steps() -> None:
    tail = config.load("remus100").tailcone
    found = refit.specification(of("remus100"))
    assert found == Spec(travel_deg=tail.travel_deg, rate_degps=tail.rate_degps)
    assert found != Spec()


def test_a_file_that_is_not_shipped_has_to_be_given() -> None:
    assert refit.specification(of("mine.toml")) == Spec()
    tail = config.load("docs/my_vehicle.toml").tailcone
    assert (
        refit.specification(of("mine.toml"), "docs/my_vehicle.toml").rate_degps == tail.rate_degps
    )
