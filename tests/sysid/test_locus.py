"""Root loci against the loops' own poles, the margins of their frequency responses, and a delay's textbook forms."""

import math

import numpy as np
import pytest

from sysid import locus, loops, planes
from sysid.loops import Lag
from sysid.tables import TABLE_1_INITIAL, TABLE_3_INITIAL

LAG = Lag(0.3)
YAW, PITCH = planes.yaw_plane(TABLE_1_INITIAL), planes.pitch_plane(TABLE_1_INITIAL)


def test_a_locus_passes_through_the_loops_own_poles() -> None:
    heading, depth = loops.close_heading(YAW, LAG, TABLE_3_INITIAL), loops.close_depth(PITCH, LAG, TABLE_3_INITIAL)
    opened = ((heading, locus.at_duct(heading, 3)), (depth, locus.at_duct(depth, 4)), (depth, locus.at_depth(depth)))
    for closed, cut in opened:
        found = locus.poles(cut, np.array([0.5, 1.0, 2.0]))[1]
        np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(loops.poles(closed)), atol=1e-9)


def test_the_locus_crosses_the_axis_at_the_gain_margin() -> None:
    """The delay is Pade's there and a true one here."""
    cut = locus.at_duct(loops.close_heading(YAW, LAG, TABLE_3_INITIAL, order=6), 3)
    margins = loops.margins(loops.heading_loops(loops.responses(YAW, LAG), TABLE_3_INITIAL)["rudder"])
    limit = 10 ** (margins.gm_db / 20)
    least = locus.damping(locus.poles(cut, np.array([0.99 * limit, 1.01 * limit])))
    assert least[0] > 0.0 > least[1]


def test_without_gain_the_poles_are_the_vehicles_and_the_tailcones() -> None:
    cut = locus.at_duct(loops.close_heading(YAW, LAG, TABLE_3_INITIAL), 3)
    found = locus.poles(cut, np.array([0.0, 1.0]))[0]
    for pole in (*np.linalg.eigvals(YAW.A), complex(-1.8, 2.4)):
        assert np.min(np.abs(found - pole)) < 1e-6


def test_a_real_pole_that_grows_is_no_damping() -> None:
    assert locus.damping(np.array([[0.1, -1.0], [-0.1, -1.0]], dtype=np.complex128)).tolist() == [-1.0, 1.0]
    assert locus.damping(np.array([[-0.6 + 0.8j, -0.6 - 0.8j]]))[0] == pytest.approx(0.6)


@pytest.mark.parametrize(("form", "tolerance"), [(1, 0.01), (2, 1e-4), (6, 1e-9), ((1.0, 0.5, 1 / 12), 1e-4)])
def test_a_delays_approximation_has_its_phase_at_slow_frequencies(form: loops.Approximation, tolerance: float) -> None:
    A, B, C, D = loops.delay(0.3, form)
    s = 1j * 1.0
    answer = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
    assert abs(answer) == pytest.approx(1.0)
    assert abs(np.angle(answer) + 0.3) < tolerance
    assert math.isfinite(D)
