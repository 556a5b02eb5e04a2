"""Effect of actuator lead, depth reference and learned trims, in closed loop."""

import msgspec
import numpy as np
import pytest

from sitl import scenario
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
"""Gains with actuator lead: 9.6 dB and 59 deg of margin. Without lead they would be half."""

REDESIGNED = {
    "TRIM_RUD_DEG": 6.07,
    "TRIM_ELE_DEG": 0.28,
    "TRIM_PIT_DEG": -1.88,
    "HDG_P": 0.99,
    "HDG_D": 1.86,
    "HDG_I": 0.069,
    "HDG_IMAX": 0.136,
    "HDG_PEAK_W": 0.83,
    "HDG_PEAK_Z": 0.71,
    "HDG_PEAK_GAIN": 1.29,
    "HDG_REF_W": 0.635,
    "HDG_REF_RATE": 5.5,
    "PTCH_P": 1.18,
    "PTCH_D": 2.06,
    "PTCH_PEAK_W": 1.32,
    "PTCH_PEAK_Z": 0.27,
    "PTCH_PEAK_GAIN": 1.25,
    "PTCH_FF": 0.18,
    "DPT_P": 0.262,
    "DPT_D": 0.45,
    "DPT_I": 0.017,
    "DPT_IMAX": 0.056,
    "DPT_REF_W": 0.635,
    "DPT_REF_LEAD": 2.85,
    "DPT_REF_RATE": 0.32,
    "ACT_LAG_W": 2.96,
    "ACT_LAG_Z": 0.59,
    "ACT_LEAD_W": 6.33,
    "ACT_LEAD_Z": 0.157,
}
"""Gains of a campaign with peak filters and a weakly damped lead."""


def steady_heading_deg(values: dict[str, float], seed: int) -> float:
    """Return the 95 % quantile of the heading error (deg) in steady flight."""
    dive = Dive(
        leg(depth_m=4.0, heading_deg=0.0, duration_s=160.0),
        sea="disturbed",
        seed=seed,
        values=values,
    )
    steady = dive.during(60.0, 150.0)
    return float(np.quantile(np.abs(np.degrees(dive["true_heading"][steady])), 0.95))


def test_actuator_lead_reduces_heading_error() -> None:
    plain, lead = (
        [steady_heading_deg(TRIMMED | values, seed) for seed in (1, 2)] for values in ({}, LEAD)
    )
    assert np.mean(lead) < 0.85 * np.mean(plain)


def depth_step(values: dict[str, float]) -> tuple[float, float]:
    """Return overshoot (m) and settling time (s, to 15 cm) of a 3 m change of depth."""
    items = leg(depth_m=3.0, heading_deg=0.0, duration_s=80.0) + leg(
        depth_m=6.0, heading_deg=0.0, duration_s=60.0, first=4
    )
    dive = Dive(items, values=TRIMMED | DEPTH_LOOP | values)
    error, t = dive["true_depth_m"] - 6.0, dive["t_s"]
    start_s = t[t > 70.0][np.argmax(error[t > 70.0] > -2.9)]
    after = (t > start_s) & (t < start_s + 50.0)
    return float(error[after].max()), float(t[after][np.abs(error[after]) > 0.15].max() - start_s)


def test_depth_reference_overshoots_less_and_settles_sooner() -> None:
    step, reference = depth_step({}), depth_step({"DPT_REF_W": 0.3, "DPT_REF_RATE": 0.3})
    assert reference[0] < 0.06 * 3.0 < step[0]
    assert reference[1] < 0.6 * step[1]


def test_redesigned_gains_hold_the_heading_without_the_gyro() -> None:
    """The observer's rates are late: with the whole gains these loops swing by 50 deg."""
    fault = {"unit": "gyro", "kind": "off", "at_s": 60.0}
    sea = msgspec.structs.replace(scenario.load("disturbed"), fault=(fault,))
    items = leg(depth_m=3.0, heading_deg=20.0, duration_s=220.0)
    dive = Dive(items, sea=sea, seed=10000, values=REDESIGNED)
    later = dive.during(90.0, 210.0)
    heading_deg = np.degrees(dive["true_heading"][later]) - 20.0
    assert np.quantile(np.abs(heading_deg), 0.95) < 5.0
    assert np.quantile(np.abs(dive["true_depth_m"][later] - 3.0), 0.95) < 0.2


def test_trim_learning_from_zero_finds_the_rudder_bias() -> None:
    """The rudder bias is 6 deg; the integrator limit allows about 1 deg."""
    values = {"HDG_I": 0.03, "HDG_IMAX": 0.02, "TRIM_AUTO_S": 20.0}
    dive = Dive(leg(depth_m=4.0, heading_deg=0.0, duration_s=300.0), values=values)
    steady = dive.during(250.0, 290.0)
    learned = np.degrees(np.mean(dive["rudder"][steady]))
    assert learned == pytest.approx(6.0, abs=0.3)
    assert abs(np.degrees(np.mean(dive["true_heading"][steady]))) < 0.5


def test_trim_learning_initial_gains_removes_heading_error() -> None:
    """Table 3's initial gains: HDG_IMAX is 0.57 deg, HDG_P is 0.65, the rudder is 6.05 deg off.

    Reference: (6.05 - 0.57) / 0.65 = 8.4 deg of steady error without trim, 0 with it.
    Tolerance: magnetometer and attitude errors of the calm sea, up to 0.2 deg.
    """
    mission = leg(depth_m=3.0, heading_deg=20.0, duration_s=200.0)
    errors_deg = {}
    for time_s in (0.0, 20.0):
        dive = Dive(mission, values={"TRIM_AUTO_S": time_s})
        heading = dive["true_heading"][dive.during(120.0, 190.0)]
        errors_deg[time_s] = float(np.degrees(np.mean(heading))) - 20.0
    assert errors_deg[0.0] == pytest.approx(-8.4, abs=0.5)
    assert abs(errors_deg[20.0]) < 0.5
