"""Reference model with its limits, and lead compensation of the tailcone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.control import reference_model
from autopilot.control.reference_model import (
    NO_REFERENCE,
    ActuatorLead,
    PeakFilter,
    ReferenceState,
    peak,
)

DT = 0.02
SERVO = ActuatorLead(3.0, 0.6, 8.0, 0.7, math.radians(15.0), math.radians(15.0))


def follow_model(
    goal: float, w: float, fastest: float, seconds: float = 60.0
) -> list[ReferenceState]:
    state, states = ReferenceState(0.0), []
    for _ in range(round(seconds / DT)):
        state = reference_model.step_reference(goal - state.value, state, w, fastest, DT)
        states.append(state)
    return states


@given(goal=st.floats(-3.0, 3.0), w=st.floats(0.2, 3.0), fastest=st.floats(0.05, 2.0))
def test_reference_arrives_without_overshoot_within_rate(
    goal: float, w: float, fastest: float
) -> None:
    states = follow_model(goal, w, fastest, seconds=20.0 / w + 3.5 / fastest)
    assert max(abs(state.rate) for state in states) <= fastest
    assert abs(states[-1].value - goal) < 0.01 * max(abs(goal), 0.01)
    beyond = max(math.copysign(1.0, goal) * (state.value - goal) for state in states)
    assert beyond < 0.02 * abs(goal) + 1e-9


def test_reference_without_rate_limit_is_critically_damped() -> None:
    states = np.array([state.value for state in follow_model(1.0, 0.5, 10.0)])
    t = DT * np.arange(1, states.size + 1)
    np.testing.assert_allclose(states, 1.0 - (1.0 + 0.5 * t) * np.exp(-0.5 * t), atol=0.01)


def test_reference_starts_no_faster_than_it_stops() -> None:
    """After a large change the rate rises within two time constants, not in one tick."""
    rates = np.array([state.rate for state in follow_model(10.0, 0.5, 0.3)])
    assert np.max(np.abs(np.diff(rates, prepend=0.0))) / DT <= 0.5 * 0.5 * 0.3 + 1e-12
    assert np.argmax(rates > 0.999 * 0.3) * DT == pytest.approx(4.0, abs=0.05)


def simulate_tailcone(wanted: np.ndarray, servo: ActuatorLead) -> tuple[np.ndarray, np.ndarray]:
    """Return (commands, duct angles); the tailcone is the lag of ``servo`` with its limits."""
    angle = rate = 0.0
    state = ReferenceState(0.0)
    commands, angles = [], []
    for value in wanted:
        command, state = reference_model.lead(float(value), state, servo, DT)
        for _ in range(20):
            accel = (
                servo.lag_radps**2 * (command - angle)
                - 2.0 * servo.lag_damping * servo.lag_radps * rate
            )
            rate = min(servo.rate_radps, max(-servo.rate_radps, rate + accel * DT / 20))
            angle += rate * DT / 20
        commands.append(command)
        angles.append(angle)
    return np.array(commands), np.array(angles)


def test_lead_duct_moves_as_faster_lag() -> None:
    wanted = np.full(150, math.radians(1.0))
    _, angles = simulate_tailcone(wanted, SERVO)
    t, w, z = DT * np.arange(1, 151), SERVO.lead_radps, SERVO.lead_damping
    damped = w * math.sqrt(1.0 - z * z)
    faster = 1.0 - np.exp(-z * w * t) * (np.cos(damped * t) + z * w / damped * np.sin(damped * t))
    assert np.max(np.abs(angles / wanted - faster)) < 0.12
    assert np.max(np.abs(angles[10:] / wanted[10:] - faster[10:])) < 0.04


@settings(max_examples=30)
@given(st.lists(st.floats(-0.6, 0.6), min_size=5, max_size=40))
def test_lead_any_command_stays_in_travel_and_follows_model(
    levels: list[float],
) -> None:
    """For steps beyond travel and rate the model commands only what the tailcone can follow."""
    wanted = np.repeat(levels, 25)
    commands, angles = simulate_tailcone(wanted, SERVO)
    assert np.max(np.abs(commands)) <= SERVO.travel_rad + 1e-12
    assert np.max(np.abs(angles)) <= SERVO.travel_rad * 1.05
    settled = simulate_tailcone(np.concatenate([wanted, np.zeros(200)]), SERVO)[1]
    assert abs(settled[-1]) < math.radians(0.05)


def test_lead_first_tick_has_no_jump() -> None:
    command, state = reference_model.lead(0.1, NO_REFERENCE, SERVO, DT)
    assert command == 0.1
    assert state == ReferenceState(0.1, 0.0)


@pytest.mark.parametrize("w_radps", [0.1, 0.8, 1.5, 3.0, 10.0])
def test_peak_filter_has_response_of_its_transfer_function(w_radps: float) -> None:
    """Reference: (s^2 + 2 z g w s + w^2) / (s^2 + 2 z w s + w^2) at s = j w_radps.

    A step of 20 ms shifts the phase by at most half a tick.
    """
    shape, dt_s = PeakFilter(1.5, 0.4, 1.6), 0.02
    s = 1j * w_radps
    broad, narrow = (s * s + 2.0 * 0.4 * g * 1.5 * s + 1.5**2 for g in (1.6, 1.0))
    times = dt_s * np.arange(round(60.0 / dt_s))
    state, output = NO_REFERENCE, []
    for command in np.sin(w_radps * times):
        filtered, state = peak(float(command), state, shape, dt_s)
        output.append(filtered)
    settled = slice(len(times) // 2, None)
    basis = np.exp(-1j * w_radps * times[settled])
    ratio = np.sum(np.array(output)[settled] * basis) / np.sum(
        np.sin(w_radps * times[settled]) * basis
    )
    assert abs(ratio - broad / narrow) < 0.03


def test_peak_filter_passes_constant_command_from_its_start() -> None:
    shape, state = PeakFilter(1.5, 0.4, 1.6), NO_REFERENCE
    for _ in range(10):
        command, state = peak(0.1, state, shape, 0.02)
        assert command == pytest.approx(0.1)
