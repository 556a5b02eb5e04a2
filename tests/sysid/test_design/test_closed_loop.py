"""Closed-loop simulation of a plane against python-control with the same equations."""

import control
import numpy as np
import pytest

from sysid.control_analysis import loop_state_space, loop_transfer
from sysid.control_analysis.loop_transfer import Lag
from sysid.data.runs import RATE_HZ
from sysid.estimation.map import steady_state
from sysid.planes import PLANES, Plane
from sysid.test_design import closed_loop
from sysid.test_design.prior import DesignPrior


@pytest.mark.parametrize("plane", ["yaw", "pitch"])
def test_simulate_pulse_response_equals_python_control(
    bench: DesignPrior, gains: dict[str, float], plane: Plane
) -> None:
    vehicle = bench.vehicle(bench.mean)
    linear, actuator = steady_state.linear_plane(vehicle, plane), vehicle.actuators[plane]
    lag = Lag(
        actuator.delay_s + loop_transfer.SAMPLING_S,
        actuator.natural_frequency_radps,
        actuator.damping_ratio,
    )
    close = (loop_state_space.close_heading, loop_state_space.close_depth)[PLANES[plane].index]
    closed = close(linear, lag, gains, order=6)
    _, B = loop_state_space.plane_with_tailcone(linear, lag, 6)
    drive = np.concatenate([B, np.zeros(len(closed.A) - len(B))])
    n = linear.A.shape[0]
    outputs = np.eye(len(closed.A))[1:n]
    ticks = np.arange(0, 40 * int(RATE_HZ)) / RATE_HZ
    pulse = np.where(ticks < 2.0, 0.05, 0.0)
    system = control.ss(closed.A, drive[:, None], outputs, np.zeros((n - 1, 1)))
    expected = control.forced_response(system, ticks, pulse).outputs.T
    found = closed_loop.simulate(
        closed_loop.of_vehicle(vehicle, plane, gains, bench.noise[plane]), plane, pulse
    ).motion[:, : n - 1]
    # A tick of hold and the Pade delay stand between the two.
    assert np.max(np.abs(found - expected)) < 0.04 * np.max(np.abs(expected))


def test_simulate_command_is_test_plus_feedback(
    bench: DesignPrior, gains: dict[str, float]
) -> None:
    vehicle = bench.vehicle(bench.mean)
    held = closed_loop.of_vehicle(vehicle, Plane.YAW, gains, bench.noise[Plane.YAW])
    signal = np.where(np.arange(1500) < 100, 0.05, 0.0)
    flown = closed_loop.simulate(held, Plane.YAW, signal)
    law = -gains["HDG_D"] * flown.motion[:, 0] - gains["HDG_P"] * flown.motion[:, 1]
    integral = np.concatenate([[0.0], np.cumsum(-gains["HDG_I"] * flown.motion[:-1, 1]) / RATE_HZ])
    np.testing.assert_allclose(flown.command_rad, signal + law + integral, atol=1e-12)
