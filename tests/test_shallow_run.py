"""The paper's run one metre under the surface, in the seas that are shipped: waves, layers, ice."""

import numpy as np
import pytest

from tests.helpers.closed_loop import Dive
from tests.test_closed_loop import IMPROVED, TRIM, legs


@pytest.mark.parametrize(
    ("sea", "offset_m", "swing_m"),
    [
        ("calm", 0.02, 0.02),
        ("swell", 0.05, 0.15),
        ("estuary", 0.08, 0.02),
        ("under_ice", 0.02, 0.03),
    ],
)
def test_the_shallow_run_is_flown_at_its_depth_and_ends_at_the_surface(
    sea: str, offset_m: float, swing_m: float
) -> None:
    """Off by what the pressure sensor is wrong in water of another density; swinging with the
    swell."""
    dive = Dive(legs((1.0, 0.0, 150.0)), sea=sea, values={**IMPROVED, **TRIM})
    steady = dive.during(80.0, 150.0)
    depth = dive["true_depth_m"][steady]
    assert depth.mean() == pytest.approx(1.0, abs=offset_m)
    assert depth.std() < swing_m
    assert np.degrees(np.abs(dive["heading"][steady])).max() < 4.0
    assert dive.texts()[-1] == "Surfaced: disarmed"


def test_swell_swings_her_and_the_estuary_misleads_her() -> None:
    """Less pressure for the same depth: 1 m of water of 1009 kg/m3 is told as 0.984 m."""
    steady = {
        sea: Dive(legs((1.0, 0.0, 150.0)), sea=sea, values={**IMPROVED, **TRIM})
        for sea in ("swell", "estuary")
    }
    swell, estuary = (dive["true_depth_m"][dive.during(80.0, 150.0)] for dive in steady.values())
    assert swell.std() > 0.05
    assert estuary.mean() > 1.015
