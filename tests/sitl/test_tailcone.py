"""The tailcone against scipy's linear system, and against the geometry of its rate limit."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import signal

from sitl import tailcone
from sitl.tailcone import Servo

SUBSTEP_S = 0.005
TRAVEL_RAD = RATE_RADPS = math.radians(15.0)
DELAY_S = 0.3
LAG = signal.TransferFunction([1.0], [1.0 / 9.0, 0.4, 1.0])
FASTER_THAN_THE_LIMIT = {"natural_frequency_radps": 2000.0, "damping": 1.0, "delay_s": 0.0}


def axis(**changes: float) -> Servo:
    caribou = {
        "natural_frequency_radps": 3.0,
        "damping": 0.6,
        "delay_s": DELAY_S,
        "travel_rad": TRAVEL_RAD,
        "rate_limit_radps": RATE_RADPS,
        "bias_rad": 0.0,
        "substep_s": SUBSTEP_S,
    }
    return tailcone.servo(**(caribou | changes))


def drive(servo: Servo, commands: Any) -> NDArray[np.float64]:
    """Duct angle after each substep of as many commands."""
    state, angles, one = tailcone.at_rest(servo), [], np.empty(1)
    for command in commands:
        tailcone.advance(servo, state, float(command), one, tailcone.CERTAIN)
        angles.append(tailcone.duct_angle_rad(servo, state))
    return np.array(angles)


def seconds(duration: float) -> NDArray[np.float64]:
    return np.arange(0.0, duration, SUBSTEP_S)


@pytest.mark.parametrize("delay_s", [0.0, 0.005, 0.3, 0.3025])
def test_a_small_step_is_the_delayed_second_order_response(delay_s: float) -> None:
    size = math.radians(1.0)
    angles = drive(axis(delay_s=delay_s), np.full(1000, size))
    since_arrival = SUBSTEP_S * np.arange(1, 1001) - delay_s
    expected = size * np.interp(since_arrival, *signal.step(LAG, T=np.arange(0.0, 6.0, 0.0005)), left=0.0)
    # A delay that ends within a substep is met by the mean command of that substep: off by at most (omega h)^2 / 8.
    whole = (delay_s / SUBSTEP_S).is_integer()
    np.testing.assert_allclose(angles, expected, atol=size * (1e-9 if whole else (3.0 * SUBSTEP_S) ** 2 / 8.0))


@pytest.mark.parametrize("frequency_hz", [0.1, 0.25, 0.48, 0.75, 1.5])
def test_small_signals_follow_the_bode_plot(frequency_hz: float) -> None:
    omega = 2.0 * math.pi * frequency_hz
    t = seconds(40.0 / frequency_hz)
    settled = t >= 20.0 / frequency_hz
    command = math.radians(0.5) * np.sin(omega * t)
    angle = drive(axis(), command)
    probe = np.exp(-1j * omega * t[settled])
    measured = (angle[settled] @ probe) / (command[settled] @ probe)
    # A command held over a substep lags half of it; the angle is read at its end.
    expected = signal.freqresp(LAG, [omega])[1][0] * np.exp(-1j * omega * (DELAY_S - SUBSTEP_S / 2.0))
    assert abs(measured / expected - 1.0) < 2e-3


@pytest.mark.parametrize(("peak_to_peak_deg", "limit_hz"), [(30.0, 0.25), (10.0, 0.75)])
def test_the_rate_limit_sets_the_highest_frequency_that_passes(peak_to_peak_deg: float, limit_hz: float) -> None:
    """The paper's geometry: a cycle of p degrees peak to peak is 2p degrees of travel, at 15 deg/s."""

    def passed(frequency_hz: float) -> float:
        t = seconds(12.0 / frequency_hz)
        command = math.radians(peak_to_peak_deg / 2.0) * signal.sawtooth(2.0 * math.pi * frequency_hz * t, width=0.5)
        angle = drive(axis(**FASTER_THAN_THE_LIMIT), command)[t > 4.0 / frequency_hz]
        return math.degrees(np.ptp(angle)) / peak_to_peak_deg

    assert passed(0.98 * limit_hz) == pytest.approx(1.0, abs=0.01)
    assert passed(1.25 * limit_hz) < 0.9


def test_large_sweeps_are_limited_before_small_ones() -> None:
    def gain(peak_to_peak_deg: float, frequency_hz: float) -> float:
        t = seconds(10.0 / frequency_hz)
        command = math.radians(peak_to_peak_deg / 2.0) * np.sin(2.0 * math.pi * frequency_hz * t)
        return math.degrees(np.ptp(drive(axis(), command)[t > 5.0 / frequency_hz])) / peak_to_peak_deg

    linear = abs(signal.freqresp(LAG, [2.0 * math.pi * 0.4])[1][0])
    assert gain(10.0, 0.4) == pytest.approx(linear, rel=0.01)
    assert gain(30.0, 0.4) < 0.6 * linear


def test_the_bias_moves_the_duct_and_nothing_else() -> None:
    commands = np.radians(np.linspace(-20.0, 20.0, 500))
    bias = math.radians(-6.0)
    np.testing.assert_allclose(drive(axis(bias_rad=bias), commands), drive(axis(), commands) + bias, atol=1e-15)


def test_the_duct_leaves_its_stop_as_soon_as_the_command_does() -> None:
    at_the_stop = drive(axis(), np.full(2000, 10.0))
    assert at_the_stop[-1] == pytest.approx(TRAVEL_RAD, abs=1e-9)
    turned_back = drive(axis(), np.concatenate([np.full(2000, 10.0), np.full(200, -10.0)]))[2000:]
    arrival = round(DELAY_S / SUBSTEP_S)
    assert turned_back[arrival - 1] == pytest.approx(TRAVEL_RAD, abs=1e-9)
    assert turned_back[arrival + 1] < TRAVEL_RAD - 1e-6


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60), st.integers(1, 40))
def test_no_command_exceeds_rate_or_travel(commands: list[float], hold: int) -> None:
    angles = drive(axis(), np.repeat(commands, hold))
    assert np.max(np.abs(angles)) <= TRAVEL_RAD
    assert np.max(np.abs(np.diff(angles, prepend=0.0))) <= RATE_RADPS * SUBSTEP_S * (1.0 + 1e-12)


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=40))
def test_mirrored_commands_give_mirrored_angles(commands: list[float]) -> None:
    held = np.repeat(commands, 20)
    np.testing.assert_array_equal(drive(axis(), -held), -drive(axis(), held))
