"""Root loci against closed-loop poles, margins, and textbook approximations of a delay."""

import math

import numpy as np
import pytest

from sysid.control_analysis import loop_state_space, loop_transfer, root_locus
from sysid.control_analysis.loop_transfer import Lag
from sysid.models import linear_planes
from sysid.reproduction.paper_tables import TABLE_1_INITIAL, TABLE_3_INITIAL

LAG = Lag(0.3)
YAW, PITCH = linear_planes.yaw_plane(TABLE_1_INITIAL), linear_planes.pitch_plane(TABLE_1_INITIAL)


def test_locus_unit_gain_gives_closed_loop_poles() -> None:
    heading = loop_state_space.close_heading(YAW, LAG, TABLE_3_INITIAL)
    depth = loop_state_space.close_depth(PITCH, LAG, TABLE_3_INITIAL)
    opened = (
        (heading, root_locus.open_at_duct(heading, 3)),
        (depth, root_locus.open_at_duct(depth, 4)),
        (depth, root_locus.open_at_depth(depth)),
    )
    for closed, cut in opened:
        locus_poles = root_locus.poles(cut, np.array([0.5, 1.0, 2.0]))[1]
        np.testing.assert_allclose(
            np.sort_complex(locus_poles), np.sort_complex(loop_state_space.poles(closed)), atol=1e-9
        )


def test_locus_crosses_axis_at_gain_margin() -> None:
    """The locus has a Pade delay, the margin a true one."""
    cut = root_locus.open_at_duct(
        loop_state_space.close_heading(YAW, LAG, TABLE_3_INITIAL, order=6), 3
    )
    margins = loop_transfer.margins(
        loop_transfer.heading_loops(loop_transfer.responses(YAW, LAG), TABLE_3_INITIAL)["rudder"]
    )
    limit = 10 ** (margins.gm_db / 20)
    least = root_locus.damping(root_locus.poles(cut, np.array([0.99 * limit, 1.01 * limit])))
    assert least[0] > 0.0 > least[1]


def test_locus_zero_gain_gives_open_loop_poles() -> None:
    cut = root_locus.open_at_duct(loop_state_space.close_heading(YAW, LAG, TABLE_3_INITIAL), 3)
    locus_poles = root_locus.poles(cut, np.array([0.0, 1.0]))[0]
    for pole in (*np.linalg.eigvals(YAW.A), complex(-1.8, 2.4)):
        assert np.min(np.abs(locus_poles - pole)) < 1e-6


def test_damping_unstable_real_pole_is_minus_one() -> None:
    assert root_locus.damping(
        np.array([[0.1, -1.0], [-0.1, -1.0]], dtype=np.complex128)
    ).tolist() == [-1.0, 1.0]
    assert root_locus.damping(np.array([[-0.6 + 0.8j, -0.6 - 0.8j]]))[0] == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("form", "tolerance"), [(1, 0.01), (2, 1e-4), (6, 1e-9), ((1.0, 0.5, 1 / 12), 1e-4)]
)
def test_delay_approximation_low_frequency_phase_is_exact(
    form: loop_state_space.Approximation, tolerance: float
) -> None:
    A, B, C, D = loop_state_space.delay_state_space(0.3, form)
    s = 1j * 1.0
    answer = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
    assert abs(answer) == pytest.approx(1.0)
    assert abs(np.angle(answer) + 0.3) < tolerance
    assert math.isfinite(D)
