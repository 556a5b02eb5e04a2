"""The study's campaigns of other vehicles: what must hold of every one of them, on one."""

import pytest

from benchmarks.identification import prediction, vehicles
from sysid.estimation.map.convergence import START_COST_TOLERANCE


def test_every_start_of_a_lively_vehicle_leads_to_the_same_end() -> None:
    """Other vehicles of her prior run away where she does not: a search on whole runs is lost from
    there."""
    found = prediction.campaign(vehicles.case("remus100"), 1).found
    assert len(found.start_costs) == 8
    assert found.start_costs == pytest.approx([found.cost] * 8, rel=START_COST_TOLERANCE)
