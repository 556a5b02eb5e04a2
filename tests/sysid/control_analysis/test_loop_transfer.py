"""Loops against python-control, simulation with a true delay, and the paper's poles."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid.control_analysis import loop_state_space, loop_transfer, margins
from sysid.control_analysis.loop_transfer import Lag
from sysid.models import linear_planes
from sysid.reproduction.paper_tables import (
    TABLE_1_ADJUSTED,
    TABLE_1_INITIAL,
    TABLE_3_IMPROVED,
    TABLE_3_INITIAL,
)

LAG = Lag(0.33)
YAW, PITCH = linear_planes.yaw_plane(TABLE_1_ADJUSTED), linear_planes.pitch_plane(TABLE_1_ADJUSTED)
S = control.tf("s")


def transfer(
    plane: linear_planes.LinearPlane, state: int, order: int = 6
) -> control.TransferFunction:
    """Return the transfer function from command to a state, assembled by python-control."""
    C = np.eye(plane.A.shape[0])[[state]]
    body = control.ss2tf(control.ss(plane.A, plane.B[:, None], C, 0))
    duct = 9.0 / (S**2 + 3.6 * S + 9.0) * control.tf(*control.pade(LAG.delay_s, order))
    return body * duct


def test_margins_equal_those_of_python_control() -> None:
    g = TABLE_3_IMPROVED
    loop = transfer(YAW, 2) * (g["HDG_P"] + g["HDG_I"] / S + g["HDG_D"] * S)
    gm, pm, _, _, crossover, _ = control.stability_margins(control.minreal(loop, verbose=False))[:6]
    _, _, sm, *_ = control.stability_margins(control.minreal(loop, verbose=False))
    computed = loop_transfer.margins(
        loop_transfer.heading_loops(loop_transfer.responses(YAW, LAG), g)["rudder"]
    )
    assert computed.gm_db == pytest.approx(20 * math.log10(gm), abs=0.05)
    assert computed.pm_deg == pytest.approx(pm, abs=0.2)
    assert computed.max_sensitivity == pytest.approx(1 / sm, rel=5e-3)
    assert np.isfinite(crossover)


@pytest.mark.parametrize("gains", [TABLE_3_INITIAL, TABLE_3_IMPROVED])
def test_poles_equal_those_of_python_control(gains: dict[str, float]) -> None:
    g = gains
    pitch = transfer(PITCH, 2, 4) * (g["PTCH_P"] + g["PTCH_D"] * S)
    outer = -g["PTCH_P"] * (g["DPT_P"] + g["DPT_I"] / S) * transfer(PITCH, 3, 4)
    closed = control.poles(control.minreal(1 / (1 + pitch + outer), tol=1e-4, verbose=False))
    for pole in loop_state_space.poles(loop_state_space.close_depth(PITCH, LAG, g, 4)):
        if abs(pole) < margins.MAX_POLE_RADPS:
            assert np.min(np.abs(closed - pole)) < 1e-3 * max(1.0, abs(pole))


def growth(
    plane: linear_planes.LinearPlane, gains: dict[str, float], factor: float, seconds: float = 150.0
) -> float:
    """Simulate the heading loop with scaled gain and a true delay; return growth of amplitude."""
    dt = 0.005
    late = round(LAG.delay_s / dt)
    queue = [0.0] * late
    x, angle, rate, integral = np.array([0.0, 0.0, 0.1]), 0.0, 0.0, 0.0
    sizes = []
    for _ in range(int(seconds / dt)):
        integral -= gains["HDG_I"] * x[2] * dt
        queue.append(factor * (-gains["HDG_P"] * x[2] - gains["HDG_D"] * x[1] + integral))
        command = queue.pop(0)
        rate += dt * (9.0 * (command - angle) - 3.6 * rate)
        angle += dt * rate
        x = x + dt * (plane.A @ x + plane.B * angle)
        sizes.append(abs(x[2]))
    third = len(sizes) // 3
    return float(max(sizes[-third:]) / max(sizes[third : 2 * third]))


def test_gain_margin_true_delay_is_the_stability_limit() -> None:
    cut = loop_transfer.heading_loops(loop_transfer.responses(YAW, LAG), TABLE_3_IMPROVED)["rudder"]
    limit = 10 ** (loop_transfer.margins(cut).gm_db / 20)
    assert growth(YAW, TABLE_3_IMPROVED, 0.95 * limit) < 1.0
    assert growth(YAW, TABLE_3_IMPROVED, 1.05 * limit) > 1.0


@settings(max_examples=40)
@given(st.floats(0.1, 2.5), st.floats(0.2, 5.0), st.floats(0.01, 0.1))
def test_pade_poles_agree_with_nyquist_of_true_delay(p: float, d: float, i: float) -> None:
    """Argument principle: over 0 < w < inf the phase of 1 + L grows by k pi/2 - Z pi.

    L has k = 2 integrators; Z is the number of unstable closed-loop poles.
    """
    gains = {**TABLE_3_INITIAL, "HDG_P": p, "HDG_D": d, "HDG_I": i}
    cut = loop_transfer.heading_loops(loop_transfer.responses(YAW, LAG), gains)["rudder"]
    if np.min(np.abs(1 + cut)) < 0.05:
        return  # too near the border for a grid to count
    turned = np.unwrap(np.angle(1 + cut))
    unstable_by_nyquist = round((math.pi - (turned[-1] - turned[0])) / math.pi)
    poles = loop_state_space.poles(loop_state_space.close_heading(YAW, LAG, gains, order=6))
    assert int(np.count_nonzero(poles.real > 0)) == unstable_by_nyquist


def test_step_response_equals_integrated_closed_loop() -> None:
    closed = loop_state_space.close_depth(PITCH, LAG, TABLE_3_IMPROVED)
    response = loop_state_space.step_response(closed, 3, 60.0)
    system = control.ss(closed.A, closed.reference[:, None], np.eye(len(closed.A))[[3]], 0)
    _, expected = control.step_response(system, T=np.arange(0, 60.0, 0.1))
    np.testing.assert_allclose(response, np.squeeze(expected), atol=1e-6)
    assert response[-1] == pytest.approx(1.0, abs=0.05)


def test_damping_longer_delay_is_smaller() -> None:
    model = margins.Planes(
        linear_planes.yaw_plane(TABLE_1_INITIAL), linear_planes.pitch_plane(TABLE_1_INITIAL)
    )
    dampings = [
        margins.damping(
            margins.analyse(model, TABLE_3_INITIAL, Lag(delay), Lag(delay)).poles["pitch"]
        )
        for delay in (0.1, 0.3, 0.5)
    ]
    assert dampings == sorted(dampings, reverse=True)


def test_actuator_lead_known_tailcone_gives_faster_lag() -> None:
    """With an exactly known tailcone, the frequency response and all poles agree."""
    gains = {**TABLE_3_INITIAL, "ACT_LAG_W": 3.0, "ACT_LAG_Z": 0.6, "ACT_LEAD_W": 8.0}
    faster = LAG._replace(natural_frequency_radps=8.0, damping_ratio=loop_transfer.LEAD_DAMPING)
    for plane, cuts in ((YAW, loop_transfer.heading_loops), (PITCH, loop_transfer.depth_loops)):
        undone = cuts(loop_transfer.responses(plane, LAG), gains)
        fast = cuts(loop_transfer.responses(plane, faster), TABLE_3_INITIAL)
        for name, loop in fast.items():
            np.testing.assert_allclose(undone[name], loop, rtol=1e-9)
    undone_poles = loop_state_space.poles(loop_state_space.close_heading(YAW, LAG, gains))
    cancelled = np.roots([1.0, 2 * 0.6 * 3.0, 9.0])
    expected = np.concatenate(
        [
            loop_state_space.poles(loop_state_space.close_heading(YAW, faster, TABLE_3_INITIAL)),
            cancelled,
        ]
    )
    np.testing.assert_allclose(np.sort_complex(undone_poles), np.sort_complex(expected), rtol=1e-6)


def test_actuator_lead_damping_is_that_of_the_faster_lag() -> None:
    gains = {"ACT_LAG_W": 3.0, "ACT_LAG_Z": 0.6, "ACT_LEAD_W": 8.0, "ACT_LEAD_Z": 0.2}
    faster = LAG._replace(natural_frequency_radps=8.0, damping_ratio=0.2)
    undone = loop_transfer.heading_loops(
        loop_transfer.responses(YAW, LAG), {**TABLE_3_INITIAL, **gains}
    )
    fast = loop_transfer.heading_loops(loop_transfer.responses(YAW, faster), TABLE_3_INITIAL)
    np.testing.assert_allclose(undone["rudder"], fast["rudder"], rtol=1e-9)


def test_close_depth_both_integrators_has_poles_where_loop_is_minus_one() -> None:
    """Each slow pole s of the state space solves 1 + L(s) = 0 at the elevator."""
    gains = {**TABLE_3_INITIAL, "PTCH_I": 0.05, "DPT_I": 0.004, "DPT_D": 0.3}
    lag = LAG._replace(delay_s=0.0)
    closed = loop_state_space.close_depth(PITCH, lag, gains)
    slow = [pole for pole in loop_state_space.poles(closed) if abs(pole) < 1.0]
    assert len(slow) >= 4
    wn, zeta = lag.natural_frequency_radps, lag.damping_ratio
    for s in slow:
        duct = wn**2 / (s**2 + 2.0 * zeta * wn * s + wn**2)
        _, q, theta, depth = np.linalg.solve(s * np.eye(4) - PITCH.A, PITCH.B) * duct
        forward = gains["PTCH_P"] + gains["PTCH_I"] / s
        outer = (gains["DPT_P"] + gains["DPT_I"] / s + gains["DPT_D"] * s) * depth
        assert gains["PTCH_D"] * q + forward * (theta - outer) == pytest.approx(-1.0, abs=1e-6)


def test_actuator_lead_cancelled_lag_is_not_visible() -> None:
    """The lag's poles exist next to the zeros that cancel them; the faster lag is visible."""
    both, pair = margins.Planes(YAW, PITCH), 3.0 * (-0.6 + 0.8j)
    lead = {**TABLE_3_INITIAL, "ACT_LAG_W": 3.0, "ACT_LAG_Z": 0.6, "ACT_LEAD_W": 6.0}
    undone, whole = (margins.analyse(both, gains, LAG, LAG) for gains in (lead, TABLE_3_INITIAL))
    for loop in ("heading", "pitch", "depth"):
        assert min(abs(pole - pair) for pole in undone.poles[loop]) < 1e-6
        assert min(abs(pole - pair) for pole in undone.visible[loop]) > 0.5
        assert margins.damping(undone.visible[loop]) > margins.damping(whole.visible[loop])
        assert margins.damping(whole.visible[loop]) == pytest.approx(
            margins.damping(whole.poles[loop])
        )


@pytest.mark.parametrize("peak_db", [0.005, 0.002, -0.002])
def test_margins_gain_touching_one_between_frequencies(peak_db: float) -> None:
    """An LQG loop can be so flat that it crosses unit gain twice within one step of the grid.

    The loop is an integrator with a resonance, whose largest gain of `peak_db` lies between two
    frequencies of the grid. Reference: the same transfer function on a fine grid.
    """
    grid = loop_transfer.GRID_RADPS
    fine = np.geomspace(0.2, 2.0, 100000)

    def loop(w: loop_transfer.Array, resonance_radps: float) -> loop_transfer.ComplexArray:
        s = 1j * w / resonance_radps
        return np.asarray((s**2 + 0.4 * s + 1.0) / (s**2 + 0.2 * s + 1.0) / s * np.exp(-0.3j * w))

    def largest(resonance_radps: float) -> tuple[float, float]:
        """Return gain and frequency of the local maximum."""
        gains = np.abs(loop(fine, resonance_radps))
        last = int(np.flatnonzero(np.diff(gains) > 0.0)[-1]) + 1
        return float(gains[last]), float(fine[last])

    between = math.sqrt(grid[300] * grid[301])
    resonance_radps = between / largest(1.0)[1]
    scale = 10.0 ** (peak_db / 20.0) / largest(resonance_radps)[0]
    fine_loop = scale * loop(fine, resonance_radps)
    crossings = np.flatnonzero(np.diff(np.sign(np.abs(fine_loop) - 1.0)))
    assert len(crossings) == (3 if peak_db > 0.0 else 1)
    computed = loop_transfer.margins(scale * loop(grid, resonance_radps))
    assert computed.crossover_radps == pytest.approx(fine[crossings[-1]], rel=1e-3)
    pm_deg = np.degrees(np.angle(-fine_loop[crossings]))
    # The phase is interpolated linearly: up to 0.15 deg off in a resonance.
    assert computed.pm_deg == pytest.approx(float(np.min(np.abs(pm_deg))), abs=0.2)
