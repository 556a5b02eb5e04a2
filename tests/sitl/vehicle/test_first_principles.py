"""The first-principles derivation against the paper's initial column, with known differences."""

import os
import subprocess
import sys

import pytest

from sitl.vehicle import first_principles
from sitl.vehicle.config import load

STEPS = {step.symbol: step for step in first_principles.trace(load("caribou_nominal"))}
PERCENT = {
    "Y_vdot": 1.5,
    "N_rdot": 0.5,
    "I_zz": 0.5,
    "Y_dr": 2.0,
    "N_dr": 2.0,
    "N_v": 4.0,
    "Y_r": 4.0,
    "N_r": 4.0,
    "Z_de": 2.0,
    "M_de": 2.0,
    "M_w": 4.0,
    "Z_q": 4.0,
    "M_q": 4.0,
}


@pytest.mark.parametrize(("symbol", "percent"), PERCENT.items())
def test_derived_coefficients_near_table_1(symbol: str, percent: float) -> None:
    difference_pct = STEPS[symbol].difference_pct
    assert difference_pct is not None
    assert abs(difference_pct) < percent


def test_sway_coefficient_differs_by_u_squared() -> None:
    assert STEPS["Y_v"].value == pytest.approx(-335, abs=1)
    assert STEPS["Y_v slip"].value == pytest.approx(STEPS["Y_v slip"].table, rel=1e-3)


def test_inconsistent_printed_values_are_listed() -> None:
    assert STEPS["C_D"].value == pytest.approx(0.130, abs=5e-4)
    assert STEPS["C_D balance"].value == pytest.approx(0.153, abs=5e-4)
    assert STEPS["dC_L/da"].value == pytest.approx(4.946, abs=5e-4)
    assert STEPS["duct lift"].value == pytest.approx(131.0, abs=0.05)


def test_module_prints_table_and_remarks() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "sitl.vehicle.first_principles"],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ,
    )
    assert "the table applies U^2 twice" in run.stdout
    for symbol in STEPS:
        assert f"\n{symbol} " in run.stdout
