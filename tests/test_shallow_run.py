"""The paper's run at a depth of one metre, in the shipped scenarios with waves, layers and ice."""

import numpy as np
import pytest

from tests.helpers.closed_loop import Dive
from tests.test_closed_loop import IMPROVED, TRIM, legs


@pytest.mark.parametrize(
    ("sea", "offset_m", "max_sd_m"),
    [
        ("calm", 0.02, 0.02),
        ("swell", 0.05, 0.15),
        ("estuary", 0.08, 0.02),
        ("under_ice", 0.02, 0.03),
    ],
)
def test_shallow_run_holds_depth_and_ends_at_the_surface(
    sea: str, offset_m: float, max_sd_m: float
) -> None:
    """The mean is off by the pressure sensor's error in water of another density."""
    dive = Dive(legs((1.0, 0.0, 150.0)), sea=sea, values={**IMPROVED, **TRIM})
    steady = dive.during(80.0, 150.0)
    depth = dive["true_depth_m"][steady]
    assert depth.mean() == pytest.approx(1.0, abs=offset_m)
    assert depth.std() < max_sd_m
    assert np.degrees(np.abs(dive["heading"][steady])).max() < 4.0
    assert dive.texts()[-1] == "Surfaced: disarmed"


def test_shallow_run_swell_moves_vehicle_estuary_biases_depth() -> None:
    """In water of 1009 kg/m3 a depth of 1 m is measured as 0.984 m."""
    dives = {
        sea: Dive(legs((1.0, 0.0, 150.0)), sea=sea, values={**IMPROVED, **TRIM})
        for sea in ("swell", "estuary")
    }
    swell, estuary = (dive["true_depth_m"][dive.during(80.0, 150.0)] for dive in dives.values())
    assert swell.std() > 0.05
    assert estuary.mean() > 1.015
