"""Parameters of a vehicle that are known before its first dive."""

import msgspec
import pytest

from ground.campaign import prototype
from ground.test_design import session
from sitl.vehicle import config
from sysid.test_design import prior


def test_parameters_of_a_vehicle_are_travel_and_cruise_without_trims() -> None:
    """Simulated vehicles have trims of their own, as a trim flight would measure them."""
    known = config.load("remus100")
    values = prototype.parameters_of(prior.from_file(known))
    assert values["ACT_TRAVEL_DEG"] == known.tailcone.travel_deg
    assert values["SPD_CRUISE_MPS"] == known.operating_point.speed_mps
    assert not any(name.startswith("TRIM_") for name in values)


def test_parameters_of_caribou_are_the_defaults() -> None:
    assert prototype.parameters_of(prior.from_file(config.load("caribou_nominal"))) == {}


def test_copy_of_caribou_with_other_values_is_another_vehicle() -> None:
    """A user begins with a copy of the shipped file and may leave the name in it."""
    caribou = config.load("caribou_nominal")
    faster = msgspec.structs.replace(
        caribou,
        operating_point=msgspec.structs.replace(caribou.operating_point, speed_mps=2.0),
    )
    known = prior.from_file(faster)
    assert faster.name == "caribou_nominal"
    assert prototype.parameters_of(known)["SPD_CRUISE_MPS"] == 2.0
    assert session.first_gains(known)["SPD_CRUISE_MPS"] == 2.0


def test_renamed_copy_of_caribou_is_caribou() -> None:
    renamed = msgspec.structs.replace(config.load("caribou_nominal"), name="mine")
    assert session.first_gains(prior.from_file(renamed)) == {}


@pytest.mark.parametrize("name", ["caribou_truth", "caribou_nominal"])
def test_shipped_name_of_caribou_needs_no_first_design(name: str) -> None:
    assert prototype.first_dive_parameters(name) == {}
