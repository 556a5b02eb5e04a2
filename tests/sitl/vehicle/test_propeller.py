"""Thrust follows K_T(J), also at rest and astern."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.vehicle import config, propeller
from tests.sitl.vehicle import flight

MODEL = flight.model("caribou_nominal")
CURVE = config.load("caribou_nominal").propeller


def test_58_percent_gives_operating_thrust() -> None:
    assert propeller.thrust_n(propeller.rps(0.58, MODEL), 1.3, MODEL.propeller) == pytest.approx(
        29.61, rel=1e-12
    )


@given(st.floats(0.5, 10), st.floats(-1, 4))
def test_thrust_equals_open_water_curve(n: float, speed: float) -> None:
    J = speed * (1 - CURVE.wake_fraction) / (n * CURVE.diameter_m)
    K_T = CURVE.kt_bollard - CURVE.kt_slope * J
    expected = K_T * 1025 * n**2 * CURVE.diameter_m**4
    assert propeller.thrust_n(n, speed, MODEL.propeller) == pytest.approx(
        expected, rel=1e-9, abs=1e-9
    )


@given(st.floats(-10, 10), st.floats(-3, 3))
def test_thrust_astern_is_minus_thrust_ahead(n: float, speed: float) -> None:
    assert propeller.thrust_n(-n, -speed, MODEL.propeller) == -propeller.thrust_n(
        n, speed, MODEL.propeller
    )


def test_stopped_shaft_gives_no_thrust() -> None:
    assert propeller.thrust_n(0.0, 1.3, MODEL.propeller) == 0.0
