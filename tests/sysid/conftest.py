"""One identification campaign with disturbances, simulated and fitted once for all tests."""

import pytest

from sitl.vehicle import config
from sysid import refit
from sysid.data.runs import Run
from sysid.models.model_file import IdentifiedModel
from tests.sysid import sea


@pytest.fixture(scope="session")
def bench() -> config.VehicleConfig:
    return config.load("caribou_nominal")


@pytest.fixture(scope="session")
def field() -> config.VehicleConfig:
    """Vehicle file of the simulated truth; only tests may use it."""
    return config.load("caribou_truth")


@pytest.fixture(scope="session")
def campaign(field: config.VehicleConfig) -> list[Run]:
    return sea.campaign(field, seed=1000)


@pytest.fixture(scope="session")
def model(campaign: list[Run], bench: config.VehicleConfig) -> IdentifiedModel:
    return refit.identify(campaign, bench)
