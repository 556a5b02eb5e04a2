"""Ring duct: published lift slopes, the paper's transformation matrices, and stall."""

from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.vehicle import duct
from tests.reference.cases.ring_wing import paper_force
from tests.sitl.vehicle import flight

DUCT = flight.model("caribou_nominal").duct
ANGLE = st.floats(-radians(15), radians(15))
SPEED = st.floats(-3, 3)


@given(
    st.floats(0.5, 3),
    st.floats(-0.1, 0.1),
    st.floats(0.01, 0.1),
    ANGLE,
    st.floats(-radians(15), -radians(1)),
)
def test_attached_duct_force_equals_paper(
    u: float, v: float, w: float, rudder: float, elevator: float
) -> None:
    velocity = (u, v, w)
    axis = duct.ring_axis(rudder, elevator)
    incidence = np.arccos(np.dot(velocity, axis) / np.linalg.norm(velocity))
    if incidence < DUCT.polar.stall_rad:
        assert duct.force(velocity, axis, DUCT) == pytest.approx(
            paper_force(np.array(velocity), rudder, elevator), rel=1e-9, abs=1e-9
        )


def test_duct_force_defined_at_zero_incidence_and_rest() -> None:
    assert duct.force((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), DUCT) == (0.0, 0.0, 0.0)
    X, Y, Z = duct.force((1.3, 0.0, 0.0), (1.0, 0.0, 0.0), DUCT)
    assert (Y, Z) == (0.0, 0.0)
    assert pytest.approx(-1025 / 2 * 0.0498 * 0.010 * 1.3**2) == X


@given(SPEED, SPEED, SPEED, ANGLE, ANGLE)
def test_duct_force_power_is_never_positive(
    u: float, v: float, w: float, rudder: float, elevator: float
) -> None:
    X, Y, Z = duct.force((u, v, w), duct.ring_axis(rudder, elevator), DUCT)
    assert X * u + Y * v + Z * w <= 1e-12


@given(st.floats(0, 2 * pi))
def test_duct_force_bounded_at_all_incidences(alpha: float) -> None:
    force = duct.force((cos(alpha), sin(alpha), 0.0), (1.0, 0.0, 0.0), DUCT)
    assert np.linalg.norm(force) <= DUCT.half_rho_area_kgpm * 3.5


def test_duct_lift_decreases_past_stall_without_jump() -> None:
    alpha = np.linspace(0, pi, 20001)
    lift = np.array([duct.force((cos(a), sin(a), 0.0), (1.0, 0.0, 0.0), DUCT) for a in alpha])
    across = lift[:, 0] * np.sin(alpha) - lift[:, 1] * np.cos(alpha)
    stall, separated = np.searchsorted(alpha, [DUCT.polar.stall_rad, DUCT.polar.separated_rad])
    assert across[separated] < 0.6 * across[stall]
    assert np.abs(np.diff(lift, axis=0)).max() < 0.002 * np.abs(lift).max()


@given(SPEED, SPEED, SPEED, ANGLE, ANGLE)
def test_duct_force_mirror_symmetric_to_the_bit(
    u: float, v: float, w: float, rudder: float, elevator: float
) -> None:
    X, Y, Z = duct.force((u, v, w), duct.ring_axis(rudder, elevator), DUCT)
    assert duct.force((u, -v, w), duct.ring_axis(-rudder, elevator), DUCT) == (X, -Y, Z)
