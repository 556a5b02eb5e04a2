"""Convergence of the study's campaigns, tested on one of the other vehicles."""

import pytest

from benchmarks.identification import prediction
from sysid.estimation.map.convergence import START_COST_TOLERANCE


@pytest.mark.slow
def test_all_starts_converge_for_unstable_vehicle() -> None:
    """Some vehicles of this prior are unstable: a search on whole runs diverges from there."""
    found = prediction.campaign("remus100", 1).found
    assert len(found.start_costs) == 8
    assert found.start_costs == pytest.approx([found.cost] * 8, rel=START_COST_TOLERANCE)
