"""What the loops' structure brings the vehicle in the sea: pure functions, the simulator's
physics."""

import numpy as np
import pytest

from tests.helpers.closed_loop import Dive
from tests.helpers.missions import leg

TRIMMED = {"TRIM_RUD_DEG": 6.0, "TRIM_ELE_DEG": 0.4}
DEPTH_LOOP = {
    "PTCH_P": 0.84,
    "PTCH_D": 1.4,
    "DPT_P": 0.196,
    "DPT_D": 0.144,
    "DPT_I": 0.007,
    "DPT_IMAX": 0.08,
}
LEAD = {"HDG_P": 0.88, "HDG_D": 2.1, "HDG_I": 0.027, "HDG_IMAX": 0.1, "ACT_LEAD_W": 8.0}
"""Margins of 9.6 dB and 59 deg with the lag undone; as many without it allow half the gain."""


def steady_heading_deg(values: dict[str, float], seed: int) -> float:
    dive = Dive(
        leg(depth_m=4.0, heading_deg=0.0, duration_s=160.0),
        sea="disturbed",
        seed=seed,
        values=values,
    )
    steady = dive.during(60.0, 150.0)
    return float(np.quantile(np.abs(np.degrees(dive["true_heading"][steady])), 0.95))


def test_a_tailcone_whose_lag_is_undone_holds_heading_better() -> None:
    plain, lead = (
        [steady_heading_deg(TRIMMED | values, seed) for seed in (1, 2)] for values in ({}, LEAD)
    )
    assert np.mean(lead) < 0.85 * np.mean(plain)


def depth_step(values: dict[str, float]) -> tuple[float, float]:
    """(overshoot, seconds until it stays within 15 cm) of a 3 m change of depth."""
    items = leg(depth_m=3.0, heading_deg=0.0, duration_s=80.0) + leg(
        depth_m=6.0, heading_deg=0.0, duration_s=60.0, first=4
    )
    dive = Dive(items, values=TRIMMED | DEPTH_LOOP | values)
    error, t = dive["true_depth_m"] - 6.0, dive["t_s"]
    begun = t[t > 70.0][np.argmax(error[t > 70.0] > -2.9)]
    after = (t > begun) & (t < begun + 50.0)
    return float(error[after].max()), float(t[after][np.abs(error[after]) > 0.15].max() - begun)


def test_a_way_in_depth_is_steadier_than_a_step() -> None:
    stepped, shaped = depth_step({}), depth_step({"DPT_REF_W": 0.3, "DPT_REF_RATE": 0.3})
    assert shaped[0] < 0.06 * 3.0 < stepped[0]
    assert shaped[1] < 0.6 * stepped[1]


def test_trims_are_learned_from_nothing() -> None:
    """Six degrees of rudder bias that nobody told of, an integrator that could carry one of
    them."""
    values = {"HDG_I": 0.03, "HDG_IMAX": 0.02, "TRIM_AUTO_S": 20.0}
    dive = Dive(leg(depth_m=4.0, heading_deg=0.0, duration_s=300.0), values=values)
    steady = dive.during(250.0, 290.0)
    learned = np.degrees(np.mean(dive["rudder"][steady]))
    assert learned == pytest.approx(6.0, abs=0.3)
    assert abs(np.degrees(np.mean(dive["true_heading"][steady]))) < 0.5
