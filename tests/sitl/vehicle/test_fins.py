"""Four fins: signs of their forces, mirror symmetry, limits and energy."""

from math import radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.vehicle import fins
from sitl.vehicle.vectors import Vector, Wrench
from tests.sitl.vehicle import flight

CRUISE = (1.5, 0.0, 0.0, 0.0, 0.0, 0.0)
MODELS = {name: flight.model(name).fins for name in ("remus100", "xfin_auv")}
LAYOUT = st.sampled_from(sorted(MODELS))
SMALL = st.floats(-0.2, 0.2)


def wrench(name: str, nu: Wrench = CRUISE, rudder: float = 0.0, elevator: float = 0.0) -> Vector:
    return np.array(fins.wrench(nu, rudder, elevator, MODELS[name]))


@pytest.mark.parametrize("name", MODELS)
def test_fin_signs_of_rudder_and_elevator(name: str) -> None:
    X, Y, Z, K, M, N = wrench(name, rudder=0.1)
    assert (X < 0, Y > 0, N < 0) == (True, True, True)
    assert pytest.approx([0.0, 0.0, 0.0], abs=1e-12 * Y) == [Z, K, M]
    X, Y, Z, K, M, N = wrench(name, elevator=0.1)
    assert (X < 0, Z < 0, M < 0) == (True, True, True)
    assert pytest.approx([0.0, 0.0, 0.0], abs=-1e-12 * Z) == [Y, K, N]


@given(LAYOUT, SMALL, SMALL, SMALL, SMALL, SMALL, SMALL, SMALL)
def test_fin_wrench_mirror_symmetric(
    name: str, v: float, w: float, p: float, q: float, r: float, rudder: float, elevator: float
) -> None:
    here = wrench(name, (1.5, v, w, p, q, r), rudder, elevator)
    there = wrench(name, (1.5, -v, w, -p, q, -r), -rudder, elevator)
    assert there == pytest.approx(
        here * [1, -1, 1, -1, 1, -1], abs=1e-11 * (1 + np.abs(here).max())
    )


@given(LAYOUT, SMALL, SMALL)
def test_fin_commands_give_no_roll_moment(name: str, rudder: float, elevator: float) -> None:
    if name == "remus100":  # cruciform fins follow rudder and elevator separately
        assert wrench(name, rudder=rudder, elevator=elevator)[3] == pytest.approx(0.0, abs=1e-9)
    assert wrench(name, rudder=rudder)[3] == pytest.approx(0.0, abs=1e-9)
    assert wrench(name, elevator=elevator)[3] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_fins_damp_roll(name: str) -> None:
    assert wrench(name, (1.5, 0, 0, 0.2, 0, 0))[3] < 0 < wrench(name, (1.5, 0, 0, -0.2, 0, 0))[3]


def test_fin_angle_limited_to_travel() -> None:
    full = radians(15.0)
    both = wrench("xfin_auv", rudder=full, elevator=full)
    more = wrench("xfin_auv", rudder=2 * full, elevator=2 * full)
    assert more == pytest.approx(both, rel=1e-12)
    assert wrench("xfin_auv", rudder=full)[1] > wrench("xfin_auv", rudder=0.99 * full / 2**0.5)[1]


@given(LAYOUT, SMALL, SMALL, SMALL, SMALL, SMALL)
def test_fixed_fins_power_is_never_positive(
    name: str, v: float, w: float, p: float, q: float, r: float
) -> None:
    nu = np.array([1.5, v, w, p, q, r])
    assert nu @ wrench(name, tuple(nu)) <= 0.0
