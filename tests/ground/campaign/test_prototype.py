"""Parameters of a vehicle that are known before its first dive."""

from ground.campaign import prototype
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
