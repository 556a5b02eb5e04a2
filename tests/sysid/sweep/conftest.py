import math
from collections.abc import Callable
from typing import Any

import pytest

from mavlink_io.mission_items import MissionItem
from sitl.vehicle import config
from sysid.monte_carlo import samples
from sysid.sweep import gains
from sysid.sweep.campaigns import SweepMission
from sysid.sweep.sweep_request import SweepRequest, SweepVehicle
from sysid.test_design import prior as design_priors
from tests.helpers.missions import leg
from tests.sysid.monte_carlo.conftest import HELD, LAND, UNSTABLE

SHORT: tuple[MissionItem, ...] = (*leg(depth_m=2.0, heading_deg=10.0, duration_s=42.0), LAND)
Sweep = Callable[..., SweepRequest]


@pytest.fixture(scope="package")
def vehicle() -> SweepVehicle:
    """Return Caribou with uncertainty of every parameter, with held and with unstable gains."""
    trimmed = design_priors.with_trim(
        design_priors.from_file(config.load("caribou_nominal")),
        math.radians(6.0),
        math.radians(0.4),
    )
    uncertain = trimmed._replace(covariance=0.04 * trimmed.covariance)
    trims = samples.trims_deg(uncertain.vehicle(uncertain.mean))
    sets = tuple(
        gains.read(name, values, trims) for name, values in (("held", HELD), ("wild", UNSTABLE))
    )
    return SweepVehicle("caribou", uncertain, 1.0, sets)


@pytest.fixture(scope="package")
def request_of(vehicle: SweepVehicle) -> Sweep:
    """Return a function that makes a small sweep, with other fields as given."""

    def make(**fields: Any) -> SweepRequest:
        small = SweepRequest(
            name="plan.toml",
            vehicles=(vehicle,),
            missions=(SweepMission("short", SHORT),),
            conditions={},
            samples=2,
            chunk=2,
        )
        return small._replace(**fields)

    return make
