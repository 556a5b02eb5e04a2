"""Ways that can be followed: the reference model's limits, and a tailcone whose lag is undone."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.control import reference_model
from autopilot.control.reference_model import ActuatorLead, ReferenceState

DT = 0.02
SERVO = ActuatorLead(3.0, 0.6, 8.0, math.radians(15.0), math.radians(15.0))


def followed(goal: float, w: float, fastest: float, seconds: float = 60.0) -> list[ReferenceState]:
    way, ways = ReferenceState(0.0), []
    for _ in range(round(seconds / DT)):
        way = reference_model.step_reference(goal - way.value, way, w, fastest, DT)
        ways.append(way)
    return ways


@given(goal=st.floats(-3.0, 3.0), w=st.floats(0.2, 3.0), fastest=st.floats(0.05, 2.0))
def test_a_way_arrives_without_overshoot_and_never_too_fast(
    goal: float, w: float, fastest: float
) -> None:
    ways = followed(goal, w, fastest, seconds=20.0 / w + 3.5 / fastest)
    assert max(abs(way.rate) for way in ways) <= fastest
    assert abs(ways[-1].value - goal) < 0.01 * max(abs(goal), 0.01)
    beyond = max(math.copysign(1.0, goal) * (way.value - goal) for way in ways)
    assert beyond < 0.02 * abs(goal) + 1e-9


def test_an_unhurried_way_is_the_critically_damped_second_order_model() -> None:
    ways = np.array([way.value for way in followed(1.0, 0.5, 10.0)])
    t = DT * np.arange(1, ways.size + 1)
    np.testing.assert_allclose(ways, 1.0 - (1.0 + 0.5 * t) * np.exp(-0.5 * t), atol=0.01)


def through_the_tail(wanted: np.ndarray, servo: ActuatorLead) -> tuple[np.ndarray, np.ndarray]:
    """(commands, duct angles) where the tailcone is the lag that the servo believes, with its
    limits."""
    angle = rate = 0.0
    way: ReferenceState | None = ReferenceState(0.0)
    commands, angles = [], []
    for value in wanted:
        command, way = reference_model.lead(float(value), way, servo, DT)
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


def test_the_duct_moves_as_through_the_faster_lag() -> None:
    wanted = np.full(150, math.radians(1.0))
    _, angles = through_the_tail(wanted, SERVO)
    t, w, z = DT * np.arange(1, 151), SERVO.lead_radps, reference_model.LEAD_DAMPING
    damped = w * math.sqrt(1.0 - z * z)
    faster = 1.0 - np.exp(-z * w * t) * (np.cos(damped * t) + z * w / damped * np.sin(damped * t))
    assert np.max(np.abs(angles / wanted - faster)) < 0.12
    assert np.max(np.abs(angles[10:] / wanted[10:] - faster[10:])) < 0.04


@settings(max_examples=30)
@given(st.lists(st.floats(-0.6, 0.6), min_size=5, max_size=40))
def test_no_command_leaves_the_travel_and_the_duct_goes_where_the_model_goes(
    levels: list[float],
) -> None:
    """Steps far beyond travel and rate: the model asks only for what the tailcone can do."""
    wanted = np.repeat(levels, 25)
    commands, angles = through_the_tail(wanted, SERVO)
    assert np.max(np.abs(commands)) <= SERVO.travel_rad + 1e-12
    assert np.max(np.abs(angles)) <= SERVO.travel_rad * 1.05
    settled = through_the_tail(np.concatenate([wanted, np.zeros(200)]), SERVO)[1]
    assert abs(settled[-1]) < math.radians(0.05)


def test_it_starts_without_a_bump() -> None:
    command, way = reference_model.lead(0.1, None, SERVO, DT)
    assert command == 0.1
    assert way == ReferenceState(0.1, 0.0)
