"""State spaces of the loops: margins against the frequency responses, poles against the product."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid.control_analysis import control_systems, loop_state_space, loop_transfer, margins
from sysid.control_analysis.control_systems import MarginsDisagreeError
from sysid.control_analysis.loop_transfer import GRID_RADPS, Lag
from sysid.control_analysis.margins import Planes
from sysid.models import linear_planes
from sysid.reproduction.paper_tables import (
    TABLE_1_ADJUSTED,
    TABLE_3_IMPROVED,
    TABLE_3_INITIAL,
)

LAGS = Lag(0.33), Lag(0.31, 3.2, 0.55)
PLANES = Planes(
    linear_planes.yaw_plane(TABLE_1_ADJUSTED), linear_planes.pitch_plane(TABLE_1_ADJUSTED)
)
FULL = {
    **TABLE_3_IMPROVED,
    "PTCH_I": 0.02,
    "DPT_D": 0.6,
    "ACT_LAG_W": 3.0,
    "ACT_LAG_Z": 0.6,
    "ACT_LEAD_W": 6.0,
    "ACT_LEAD_Z": 0.25,
    "HDG_PEAK_W": 1.2,
    "HDG_PEAK_Z": 0.3,
    "HDG_PEAK_GAIN": 1.4,
    "PTCH_PEAK_W": 1.6,
    "PTCH_PEAK_Z": 0.5,
    "PTCH_PEAK_GAIN": 1.3,
}
"""Gains with every term, to test all paths of the block diagram."""


def on_grid(gains: dict[str, float]) -> dict[str, np.ndarray]:
    """Loops by `loop_transfer`, with the exact delay."""
    loops = loop_transfer.heading_loops(loop_transfer.responses(PLANES.yaw, LAGS[0]), gains)
    return loops | loop_transfer.depth_loops(loop_transfer.responses(PLANES.pitch, LAGS[1]), gains)


@pytest.mark.parametrize("gains", [TABLE_3_INITIAL, TABLE_3_IMPROVED, FULL])
def test_loops_equal_frequency_responses(gains: dict[str, float]) -> None:
    """Up to 10 rad/s, where the Pade delay of order 6 is exact to 1e-6."""
    band = (GRID_RADPS > 0.01) & (GRID_RADPS < 10.0)
    for name, loop in control_systems.open_loops(PLANES, LAGS, gains).items():
        system = control.ss(loop.A, loop.B, loop.C, loop.D)
        response = control.frequency_response(system, GRID_RADPS[band]).complex
        assert np.allclose(response, on_grid(gains)[name][band], rtol=1e-4), name


@pytest.mark.parametrize("gains", [TABLE_3_INITIAL, FULL])
def test_closed_surface_loop_has_poles_of_close_loop(gains: dict[str, float]) -> None:
    """Reference: the state equations of `loop_transfer`, with the same Pade order."""
    if "ACT_LEAD_W" in gains:
        gains = {**gains, "ACT_LEAD_W": 0.0, "PTCH_I": 0.0}
    systems = control_systems.open_loops(PLANES, LAGS, gains, order=4)
    for cut, loop in (("rudder", "heading"), ("elevator", "depth")):
        opened = control.ss(*systems[cut][:4])
        closed = control.poles(control.feedback(opened, 1))
        expected = loop_state_space.poles(loop_state_space.close_loop(loop, PLANES, LAGS, gains, 4))
        for pole in expected[np.abs(expected) < margins.MAX_POLE_RADPS]:
            assert np.min(np.abs(closed - pole)) < 1e-5, (cut, pole)


@settings(max_examples=10, deadline=None)
@given(scale=st.floats(0.4, 1.6), delay_s=st.floats(0.1, 0.5))
def test_margins_equal_those_of_design(scale: float, delay_s: float) -> None:
    scaled = {name: scale * FULL[name] for name in ("HDG_P", "HDG_D", "PTCH_P")}
    gains = {**FULL, **scaled, "PTCH_I": 0.0}
    lags = Lag(delay_s), Lag(delay_s)
    analysis = margins.analyse(PLANES, gains, *lags)
    loops = control_systems.open_loops(PLANES, lags, gains)
    confirmed = control_systems.check_margins(loops, analysis.margins)
    assert set(confirmed) == {"rudder", "heading", "elevator", "depth", "pitch"}


def test_wrong_margin_is_reported_with_its_cut() -> None:
    analysis = margins.analyse(PLANES, TABLE_3_INITIAL, *LAGS)
    loops = control_systems.open_loops(PLANES, LAGS, TABLE_3_INITIAL)
    wrong = analysis.margins | {
        "depth": analysis.margins["depth"]._replace(pm_deg=analysis.margins["depth"].pm_deg + 2.0)
    }
    with pytest.raises(MarginsDisagreeError, match="pm_deg at depth"):
        control_systems.check_margins(loops, wrong)


def test_plant_without_lead_is_body_behind_lag_and_delay() -> None:
    plants = control_systems.plants(PLANES, LAGS, {})
    assert plants["yaw"].outputs == ("r", "psi")
    assert plants["pitch"].outputs == ("q", "theta", "depth", "depth_rate")
    assert plants["yaw"].delay_s == LAGS[0].delay_s
    system = control.ss(*plants["pitch"][:4])
    w = np.array([0.3, 1.0, 3.0])
    response = control.frequency_response(system, w).complex[:, 0]
    assert np.allclose(response[3], 1j * w * response[2], rtol=1e-6), "depth rate is d/dt depth"


def test_difference_at_pitch_cut_is_an_error() -> None:
    """Pitch is limited as every other cut."""
    analysis = margins.analyse(PLANES, TABLE_3_INITIAL, *LAGS)
    loops = control_systems.open_loops(PLANES, LAGS, TABLE_3_INITIAL)
    wrong = analysis.margins | {"pitch": analysis.margins["pitch"]._replace(gm_db=1.0)}
    with pytest.raises(MarginsDisagreeError, match="gm_db at pitch"):
        control_systems.check_margins(loops, wrong)
