import math

import pytest

from sitl.vehicle import config
from sysid.planes import PLANES, Plane
from sysid.test_design import plan, prior, safety_margins
from sysid.test_design.candidates import Lengths
from sysid.test_design.prior import DesignPrior
from sysid.test_design.safety_margins import VehicleSample
from sysid.validation.crossover import gains_for


@pytest.fixture(scope="package")
def bench() -> DesignPrior:
    """Return the prior of the vehicle file after a trim flight."""
    found = prior.from_file(config.load("caribou_nominal"))
    return prior.with_trim(found, math.radians(6.0), math.radians(0.5))


@pytest.fixture(scope="package")
def gains(bench: DesignPrior) -> dict[str, float]:
    return gains_for(bench.vehicle(bench.mean))


@pytest.fixture(scope="package")
def samples(bench: DesignPrior, gains: dict[str, float]) -> dict[Plane, list[VehicleSample]]:
    return {
        plane: safety_margins.sample_vehicles(bench, plane, gains, 128, 30.0, seed=3)
        for plane in PLANES
    }


@pytest.fixture(scope="package")
def few(bench: DesignPrior) -> plan.TestPlan:
    """Return a short plan with few candidates."""
    return plan.plan(bench, SHORT)


SHORT = plan.PlanRequest(
    test_time_s=600.0,
    samples=60,
    lengths=Lengths(free_s=(15,), held_s=(30,), both_s=(), square_s=(12,)),
)
