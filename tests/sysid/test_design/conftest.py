import math

import pytest

from sitl.vehicle import config
from sysid.data.segments import Plane
from sysid.test_design import plan, prior, safety_margins
from sysid.test_design.prior import Belief
from sysid.test_design.safety_margins import Sample
from sysid.validation.crossover import gains_for


@pytest.fixture(scope="package")
def bench() -> Belief:
    """What the file tells, after a trim flight."""
    found = prior.of_file(config.load("bench"))
    return prior.trimmed(found, math.radians(6.0), math.radians(0.5))


@pytest.fixture(scope="package")
def gains(bench: Belief) -> dict[str, float]:
    return gains_for(bench.vehicle(bench.mean))


@pytest.fixture(scope="package")
def samples(bench: Belief, gains: dict[str, float]) -> dict[Plane, list[Sample]]:
    return {
        plane: safety_margins.draw(bench, plane, gains, 128, 30.0, seed=3)
        for plane in ("yaw", "pitch")
    }


@pytest.fixture(scope="package")
def few(bench: Belief) -> plan.Plan:
    """A short plan of few candidates."""
    return plan.plan(bench, SHORT)


SHORT = plan.Request(
    water_s=600.0,
    samples=60,
    lengths=plan.Lengths(free_s=(15,), held_s=(30,), both_s=(), square_s=(12,)),
)
