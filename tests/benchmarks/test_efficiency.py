"""Linear estimates of campaigns whose data alone allow a pole and a zero that cancel."""

import numpy as np
import pytest

from benchmarks.identification import efficiency, linear_truth
from sysid.estimation.linear import estimate, linear_model
from sysid.planes import Plane


@pytest.mark.parametrize(
    ("vehicle", "plane", "seed"),
    [
        ("remus100", Plane.YAW, 179),
        ("remus100", Plane.YAW, 73),
        ("remus100", Plane.PITCH, 150),
        ("xfin_auv", Plane.YAW, 42),
        ("xfin_auv", Plane.YAW, 188),
    ],
)
def test_static_gain_is_not_that_of_a_slow_mode(vehicle: str, plane: Plane, seed: int) -> None:
    """Without the vehicle file these static gains are off by 8 to 29 times the bound."""
    campaign = linear_truth.campaign(vehicle, plane, linear_truth.coloured, seed)
    found = estimate.descend(
        campaign.records, campaign.belief, "filter-error", campaign.belief.model.values
    )
    error = linear_model.derived(*found.model) - linear_model.derived(*campaign.truth)
    bound = np.sqrt(np.diag(efficiency.bound(vehicle, plane, "coloured").derived))
    assert abs(error[0]) < 4.0 * bound[0]
