"""Simulated truth: a seeded change of a vehicle file that sysid refuses as a prior."""

from pathlib import Path

import pytest

from sitl.vehicle import config
from sysid import prior_knowledge, refit
from sysid.models import parameters
from sysid.monte_carlo import perturbed_vehicle

SHIPPED = ("caribou_nominal", "remus100", "xfin_auv", "docs/my_vehicle.toml")


@pytest.mark.parametrize("vehicle", SHIPPED)
def test_perturb_stays_within_uncertainty(vehicle: str) -> None:
    prior = config.load(vehicle)
    truth = perturbed_vehicle.perturb(prior, seed=3)
    column, changed = (parameters.to_table_1_column(v.linear)._asdict() for v in (prior, truth))
    for parameter in parameters.PARAMETERS:
        name = parameter.name
        if name in column and name not in parameters.INERTIAS:
            limit = 2.718281828 ** (perturbed_vehicle.MAX_SDS * parameter.prior_sd)
            assert 1.0 / limit <= changed[name] / column[name] <= limit
    assert truth.linear != prior.linear


@pytest.mark.parametrize(
    ("vehicle", "expected_n"),
    [("caribou_nominal", 5.0), ("remus100", 0.75), ("xfin_auv", 12.3)],
)
def test_net_buoyancy_is_uncertain_in_proportion_to_the_vehicle(
    vehicle: str, expected_n: float
) -> None:
    """Caribou: 5 N of 640 kg and of 22.24 N. With 5 N, a third of draws of a 7 kg vehicle sink."""
    assert parameters.net_buoyancy_sd_n(config.load(vehicle)) == pytest.approx(expected_n, rel=5e-3)


def test_write_same_seed_same_text_and_refused_as_prior(tmp_path: Path) -> None:
    prior = config.load("remus100")
    text = perturbed_vehicle.write(prior, seed=1)
    assert text == perturbed_vehicle.write(prior, seed=1)
    assert text != perturbed_vehicle.write(prior, seed=2)
    path = tmp_path / "truth.toml"
    path.write_text(text, encoding="utf-8")
    assert config.load(path).name == "remus100_truth"
    with pytest.raises(refit.VehicleFileError, match="is the simulated truth"):
        prior_knowledge.vehicle_file(path)
