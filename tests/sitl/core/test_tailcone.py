"""The tailcone compared with scipy's linear system and with textbook backlash and lost steps."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import signal, stats

from sitl.core import tailcone
from sitl.core.tailcone import TailconeAxis

SUBSTEP_S = 0.005
TRAVEL_RAD = RATE_RADPS = math.radians(15.0)
DELAY_S = 0.3
LAG = signal.TransferFunction([1.0], [1.0 / 9.0, 0.4, 1.0])
FASTER_THAN_THE_LIMIT = {"natural_frequency_radps": 2000.0, "damping": 1.0, "delay_s": 0.0}


def axis(**changes: float) -> TailconeAxis:
    caribou = {
        "natural_frequency_radps": 3.0,
        "damping": 0.6,
        "delay_s": DELAY_S,
        "travel_rad": TRAVEL_RAD,
        "rate_limit_radps": RATE_RADPS,
        "bias_rad": 0.0,
        "substep_s": SUBSTEP_S,
    }
    return tailcone.discretise(**(caribou | changes))


def drive(servo: TailconeAxis, commands: Any, seed: int = 0) -> NDArray[np.float64]:
    """Return the duct angle after each substep of a series of commands."""
    state, angles, one, rng = tailcone.at_rest(servo), [], np.empty(1), np.random.default_rng(seed)
    for command in commands:
        tailcone.advance(servo, state, float(command), one, rng.random(1))
        angles.append(tailcone.duct_angle_rad(servo, state))
    return np.array(angles)


def seconds(duration: float) -> NDArray[np.float64]:
    return np.arange(0.0, duration, SUBSTEP_S)


@pytest.mark.parametrize("delay_s", [0.0, 0.005, 0.3, 0.3025])
def test_small_step_matches_second_order_response(delay_s: float) -> None:
    size = math.radians(1.0)
    angles = drive(axis(delay_s=delay_s), np.full(1000, size))
    since_arrival = SUBSTEP_S * np.arange(1, 1001) - delay_s
    times, response = signal.step(LAG, T=np.arange(0.0, 6.0, 0.0005))
    expected = size * np.interp(since_arrival, times, response, left=0.0)
    # A delay that ends within a substep is met by the mean command of that substep: off by at most
    # (omega h)^2 / 8.
    whole = (delay_s / SUBSTEP_S).is_integer()
    np.testing.assert_allclose(
        angles, expected, atol=size * (1e-9 if whole else (3.0 * SUBSTEP_S) ** 2 / 8.0)
    )


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
    expected = signal.freqresp(LAG, [omega])[1][0] * np.exp(
        -1j * omega * (DELAY_S - SUBSTEP_S / 2.0)
    )
    assert abs(measured / expected - 1.0) < 2e-3


@pytest.mark.parametrize(("peak_to_peak_deg", "limit_hz"), [(30.0, 0.25), (10.0, 0.75)])
def test_rate_limit_sets_highest_frequency(peak_to_peak_deg: float, limit_hz: float) -> None:
    """The paper's geometry: p degrees peak to peak are 2p degrees per cycle, at 15 deg/s."""

    def passed(frequency_hz: float) -> float:
        t = seconds(12.0 / frequency_hz)
        command = math.radians(peak_to_peak_deg / 2.0) * signal.sawtooth(
            2.0 * math.pi * frequency_hz * t, width=0.5
        )
        angle = drive(axis(**FASTER_THAN_THE_LIMIT), command)[t > 4.0 / frequency_hz]
        return math.degrees(np.ptp(angle)) / peak_to_peak_deg

    assert passed(0.98 * limit_hz) == pytest.approx(1.0, abs=0.01)
    assert passed(1.25 * limit_hz) < 0.9


def test_rate_limit_reduces_gain_of_large_sweeps() -> None:
    def gain(peak_to_peak_deg: float, frequency_hz: float) -> float:
        t = seconds(10.0 / frequency_hz)
        command = math.radians(peak_to_peak_deg / 2.0) * np.sin(2.0 * math.pi * frequency_hz * t)
        return (
            math.degrees(np.ptp(drive(axis(), command)[t > 5.0 / frequency_hz])) / peak_to_peak_deg
        )

    linear = abs(signal.freqresp(LAG, [2.0 * math.pi * 0.4])[1][0])
    assert gain(10.0, 0.4) == pytest.approx(linear, rel=0.01)
    assert gain(30.0, 0.4) < 0.6 * linear


def test_bias_is_added_to_duct_angle() -> None:
    commands = np.radians(np.linspace(-20.0, 20.0, 500))
    bias = math.radians(-6.0)
    np.testing.assert_allclose(
        drive(axis(bias_rad=bias), commands), drive(axis(), commands) + bias, atol=1e-15
    )


def test_duct_leaves_end_stop_without_windup() -> None:
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


SWEEPS = st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=40)


@given(SWEEPS, st.floats(0.01, 1.0), st.floats(-6.0, 6.0))
def test_duct_angle_is_whole_steps_plus_bias(
    commands: list[float], step_deg: float, bias_deg: float
) -> None:
    held, step, bias = np.repeat(commands, 30), math.radians(step_deg), math.radians(bias_deg)
    smooth = drive(axis(), held)
    stepped = drive(axis(step_rad=step, bias_rad=bias), held) - bias
    np.testing.assert_allclose(stepped / step, np.round(stepped / step), atol=1e-6)
    assert np.max(np.abs(stepped)) <= TRAVEL_RAD + 1e-12
    inside = np.abs(smooth) <= TRAVEL_RAD - step
    assert np.max(np.abs(stepped - smooth)[inside], initial=0.0) <= 0.5 * step + 1e-12


@given(SWEEPS, st.floats(0.05, 3.0))
def test_backlash_matches_reference_model(turning_points: list[float], play_deg: float) -> None:
    """The duct stays until one side of the gap reaches it, then follows half the play behind."""
    play, held = math.radians(play_deg), np.repeat(turning_points, 60)
    motor, duct = drive(axis(), held), drive(axis(backlash_rad=play), held)
    expected, at = [], 0.0
    for angle in motor:
        at = min(max(at, angle - 0.5 * play), angle + 0.5 * play)
        expected.append(at)
    np.testing.assert_allclose(duct, expected, atol=1e-15)


def test_slow_sweep_hysteresis_equals_backlash() -> None:
    t = seconds(80.0)
    command = math.radians(10.0) * signal.sawtooth(2.0 * math.pi * t / 40.0, width=0.5)
    motor, duct = drive(axis(), command), drive(axis(backlash_rad=math.radians(1.2)), command)
    for angle_deg in (-5.0, 0.0, 5.0):
        crossings = np.flatnonzero(np.diff(np.sign(motor - math.radians(angle_deg))))[-2:]
        assert math.degrees(abs(np.diff(duct[crossings])[0])) == pytest.approx(1.2, abs=0.01)


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_backlash_matches_describing_function(share: float) -> None:
    """Backlash of half-width b with a sine of amplitude A.

    Source: Slotine and Li 1991, Applied Nonlinear Control, 5.3.
    """
    size, omega = math.radians(2.0), 0.5
    amplitude = size * abs(signal.freqresp(LAG, [omega])[1][0])
    b = 0.5 * share * amplitude
    x = 2.0 * b / amplitude - 1.0
    in_phase = (0.5 * math.pi - math.asin(x) - x * math.sqrt(1.0 - x * x)) / math.pi
    in_quadrature = 4.0 * b / (math.pi * amplitude) * (b / amplitude - 1.0)
    t = seconds(4.0 * 2.0 * math.pi / omega)
    last = t >= 2.0 * 2.0 * math.pi / omega
    command = size * np.sin(omega * t)
    probe = np.exp(-1j * omega * t[last])
    tight, loose = (
        drive(axis(backlash_rad=play), command)[last] @ probe for play in (0.0, 2.0 * b)
    )
    assert abs(loose / tight - complex(in_phase, in_quadrature)) < 2e-3


def test_axis_without_steps_and_backlash_equals_lag() -> None:
    servo = axis()
    state, one = tailcone.at_rest(servo), np.empty(1)
    for command in np.repeat(np.random.default_rng(2).uniform(-0.4, 0.4, 60), 40):
        tailcone.advance(servo, state, command, one)
        assert tailcone.duct_angle_rad(servo, state) == state[tailcone.COMMANDED]


STEP_DEG, CHANCE = 0.05, 0.02
LOSING = {"step_rad": math.radians(STEP_DEG), "lost_step_chance": CHANCE}


def swings(count: int) -> NDArray[np.float64]:
    """Return commands from neutral to 10 degrees and back, ``count`` times."""
    return np.tile(np.repeat(np.radians([10.0, 0.0]), round(4.0 / SUBSTEP_S)), count)


def test_lost_steps_accumulate_as_random_walk() -> None:
    """The error after n steps, each lost with probability p, has the variance n p (1 - p)."""
    swung = 3
    errors = np.array(
        [
            math.degrees(drive(axis(**LOSING), swings(swung), seed)[-1]) / STEP_DEG
            for seed in range(100)
        ]
    )
    # The lag overshoots, so the motor turns further than the commands.
    path = np.sum(
        np.abs(np.diff(drive(axis(step_rad=LOSING["step_rad"]), swings(swung)), prepend=0.0))
    )
    variance = path / LOSING["step_rad"] * CHANCE * (1.0 - CHANCE)
    np.testing.assert_allclose(errors, np.round(errors), atol=1e-6)
    assert abs(np.mean(errors)) < 4.0 * math.sqrt(variance / errors.size)
    assert np.var(errors) == pytest.approx(variance, rel=4.0 * math.sqrt(2.0 / errors.size))


def test_lost_steps_depend_on_seed_only() -> None:
    first, again, other = (drive(axis(**LOSING), swings(2), seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_slow_motor_loses_no_steps() -> None:
    slow = np.radians(np.linspace(0.0, 10.0, 2000))  # 1 deg/s
    careful = LOSING | {"lost_step_chance": 0.5, "lost_step_above_radps": math.radians(5.0)}
    exact = drive(axis(step_rad=LOSING["step_rad"]), slow)
    np.testing.assert_array_equal(drive(axis(**careful), slow), exact)
    assert not np.array_equal(drive(axis(**careful | {"lost_step_above_radps": 0.0}), slow), exact)


@given(st.integers(1, 40), st.floats(1e-4, 0.9), st.floats(0.0, 0.9999))
def test_lost_steps_are_binomial(turned: int, chance: float, quantile: float) -> None:
    distribution = stats.binom(turned, chance)
    lost = tailcone._lost_steps(turned, chance, quantile)
    assert distribution.cdf(lost) >= quantile - 1e-9
    assert lost == 0 or distribution.cdf(lost - 1) <= quantile + 1e-9
