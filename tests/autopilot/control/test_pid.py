"""PID controller: limits, anti-windup, no derivative kick, no jump with new gains."""

import math

from hypothesis import given
from hypothesis import strategies as st

from autopilot.control.pid import Gains, pid

finite = st.floats(-10.0, 10.0)
gain = st.floats(0.0, 5.0)


@given(
    error=finite, rate=finite, integral=finite, p=gain, d=gain, i=gain, limit=st.floats(0.01, 1.0)
)
def test_output_and_integral_stay_within_limits(
    error: float, rate: float, integral: float, p: float, d: float, i: float, limit: float
) -> None:
    start = max(-0.1, min(0.1, integral))
    output, kept = pid(error, rate, Gains(p, d, i, 0.1), start, 0.02, -limit, limit)
    assert -limit <= output <= limit
    assert abs(kept) <= 0.1


def test_integral_at_actuator_limit_is_frozen() -> None:
    gains = Gains(1.0, 0.0, 1.0, 10.0)
    integral = 0.0
    for _ in range(1000):
        _, integral = pid(5.0, 0.0, gains, integral, 0.02, -1.0, 1.0)
    assert integral == 0.0
    output, _ = pid(-0.5, 0.0, gains, integral, 0.02, -1.0, 1.0)
    assert output == -0.5, "the output leaves its stop at once when the error turns"


def test_integral_at_actuator_limit_unwinds() -> None:
    _, kept = pid(-5.0, 0.0, Gains(0.0, 0.0, 1.0, 10.0), 4.0, 0.02, -1.0, 1.0)
    assert kept < 4.0


def test_integral_equals_time_integral_of_error() -> None:
    integral = 0.0
    for _ in range(500):
        _, integral = pid(0.2, 0.0, Gains(0.0, 0.0, 0.03, 1.0), integral, 0.02, -1.0, 1.0)
    assert math.isclose(integral, 0.03 * 0.2 * 10.0, rel_tol=1e-9)


def test_new_gains_keep_output_continuous() -> None:
    before, _ = pid(0.0, 0.0, Gains(1.0, 1.0, 0.01, 0.1), 0.05, 0.02, -1.0, 1.0)
    after, _ = pid(0.0, 0.0, Gains(3.0, 2.0, 0.5, 0.1), 0.05, 0.02, -1.0, 1.0)
    assert before == after == 0.05


def test_integral_above_rate_limit_is_frozen() -> None:
    gains = Gains(1.0, 0.0, 1.0, 1.0, i_rate=0.05)
    assert pid(0.2, 0.06, gains, 0.1, 0.02, -1.0, 1.0)[1] == 0.1
    assert pid(0.2, -0.04, gains, 0.1, 0.02, -1.0, 1.0)[1] > 0.1
