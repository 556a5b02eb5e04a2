"""Common practice in the identification study: its fast simulation is scipy.signal.lsim's."""

import numpy as np
import pytest

from benchmarks.identification import baseline, linear_truth
from sysid.planes import Plane


@pytest.mark.parametrize("plane", list(Plane))
def test_simulate_compiled_matches_lsim(plane: Plane) -> None:
    campaign = linear_truth.campaign("caribou", plane, linear_truth.white, seed=1)
    for record in campaign.records[:3]:
        expected = baseline.simulate_lsim(campaign.truth, record)
        simulated = baseline.simulate_compiled(campaign.truth, record)
        assert np.ptp(expected) > 0.01
        np.testing.assert_allclose(simulated, expected, rtol=1e-9, atol=1e-12)
